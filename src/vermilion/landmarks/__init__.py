"""66 facial landmarks in images: networks, files of other trackers, or a trained regressor."""
