from .judge import CameraJudgement as CameraJudgement
from .refinement import Refinement as Refinement
from .refinement import refine as refine
