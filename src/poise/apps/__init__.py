"""What people run: scenarios, their reports, and a person at the controls."""
