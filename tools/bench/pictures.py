"""Pictures as arrays."""
import numpy as np
import OpenEXR


def channels(path, prefix=""):
    """R, G and B of an OpenEXR file, or others with a prefix."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        found = file.channels()
        return np.stack([found[prefix + c].pixels for c in "RGB"], -1).astype(np.float64)
