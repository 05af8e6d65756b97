"""Differences between the engine and the paper at each part of an iteration, a sentence each."""

from app.debugger.iteration_query import IterationFacts
from fairing.options import FairingOptions
from fairing.terms.names import PHOTOS


def difference_at(part: str, options: FairingOptions, facts: IterationFacts) -> str:
    """What the engine does otherwise than the paper at this part, under these options."""
    step = facts.step
    level = facts.level
    if part == "warp":
        if options.cells.warp == "affine":
            return "As in the paper: each face is mapped from the photo to its cell by an affine warp."
        return "The paper warps by an affine map; the engine uses the homography of the face's plane, which is exact."
    if part == "eigenspace":
        return "As in the paper: the largest singular vectors of the cells" + (
            ", after removing the mean cell." if options.eigenspace.centered else "; no mean is removed."
        )
    if part == "residual":
        return "As in the paper; samples that a photo does not show (grey) are left out."
    if part == "weights":
        rule, norm = options.levels[level].sigma_rule, facts.cells.norm
        other = "" if norm == "geman_mcclure" else f" The paper has the norm of Geman and McClure; here it is “{norm}”."
        if rule == "paper":
            return f"As in the paper: σ = max|e| / √3 at the beginning of the sweep.{other}"
        return f"The paper sets σ = max|e| / √3; on this level the engine uses the rule “{rule}”.{other}"
    if part == "jacobian":
        if options.step.solver == "alternating":
            return "As in the paper: U and c are held fixed."
        return (
            "The paper holds U and c fixed; the engine eliminates them (variable projection), so only the part of the "
            "derivative that the eigenspace cannot take up is left."
        )
    if part == "normal":
        others = [name for name, H in step.hessians.items() if name != PHOTOS and H.any()] if step else []
        if not others:
            return "As in the paper: the sum over the faces around the vertex; no other term pulls at this one."
        return f"The paper sums over the faces around the vertex; the engine adds its other terms: {', '.join(others)}."
    if part == "solve":
        if step is not None and step.trial.block.coupled:
            return (
                "The paper solves for one vertex at a time; the engine solves one sparse system for all of them, because "
                "faces share vertices."
            )
        return "As in the paper: one 3 × 3 system for each vertex, with damping after a rejection."
    if part == "limit":
        longest = options.step.max_step * max(1.0, options.levels[level].blur)
        return (
            "The paper itself gives no limit; the engine and paper.py do. Here a step moves no vertex farther than "
            f"{longest:.3g} px in a photo and folds no face."
        )
    if step is not None and step.trial.block.coupled:
        return (
            "The paper does not test its steps; the engine accepts one if the objective of all vertices does not rise."
        )
    return "The paper does not test its steps; the engine accepts one if the vertex's objective does not rise."
