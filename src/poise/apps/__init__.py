"""Applications: scenarios, reports, campaigns, scorecards, onboarding and live control."""
