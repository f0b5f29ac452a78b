"""The plots of the report, a file for each subject; all of them need matplotlib."""
