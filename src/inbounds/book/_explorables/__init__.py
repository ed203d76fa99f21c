"""What explorables share (frame.py), and their mathematics in JavaScript (*.js)."""
