"""Images and video, read and written; colour, sampling, drawing."""
