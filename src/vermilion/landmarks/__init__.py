"""66 facial landmarks in pictures: networks, files of other trackers, or a trained regressor."""
