"""What a file's tags say about its images, and how they become plain sRGB or linear images."""
