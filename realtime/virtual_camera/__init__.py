"""A camera of a scene that is there now: read like cv2.VideoCapture, and streamed to software that knows no better."""
