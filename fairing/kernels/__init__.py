"""The hot loops: sample the cells of a face, fit its eigenspace, weigh the residual, build the normal equations."""
