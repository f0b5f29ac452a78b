"""Other packages' whole-body controllers, each in an environment and a process of its own."""

from benchmarks.peers.process import PEERS, PeerProcess

__all__ = ["PEERS", "PeerProcess"]
