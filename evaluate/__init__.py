"""What a run looked like: motion files, figures and figures of merit."""
