from .find import find_points as find_points
from .options import FeatureOptions as FeatureOptions
from .points import FeaturePoints as FeaturePoints
