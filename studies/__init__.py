"""The papers' own experiments: each study gives findings, tables and figures beside the paper's."""
