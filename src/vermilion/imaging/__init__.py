"""Images and video read and written as they are meant: tags, colours, sampling, drawing."""
