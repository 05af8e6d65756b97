"""A recorded run as a file to hand out: a page that replays it, a report, a picture, a video."""
