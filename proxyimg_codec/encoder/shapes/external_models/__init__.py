"""Models of other projects, as files of the user: SAM, Depth Anything, saliency, LaMa."""
