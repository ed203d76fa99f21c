"""What a reader's own code must do, as named checks: graders and chapters ask the same ones."""
