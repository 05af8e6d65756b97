"""Minimum cut of a graph with a source and a sink, by maximum flow."""

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

LARGEST_SUM = 2**30
"""Capacities are scaled to integers whose sum into the sink stays below, ..."""
FINEST = 1000.0
"""... with at most this many steps of 1."""


def minimum_cut(n: int, ends: np.ndarray, costs: np.ndarray, is_source: np.ndarray, to_sink: np.ndarray) -> np.ndarray:
    """(n,) bool: nodes on the source's side of a minimum cut, of several that with the fewest nodes.

    Args:
        ends: (e, 2) int: directed edges; several between the same nodes add up.
        costs: (e,) float: cost of an edge if it leads from the source's side to the sink's.
        is_source: (n,) bool: nodes that are on the source's side at any cost.
        to_sink: (n,) float: cost of a node on the source's side.
    """
    node = np.cumsum(~is_source)
    node[is_source] = 0
    sink = int(node.max(initial=0)) + 1
    scale = min(FINEST, LARGEST_SUM / max(float(to_sink.sum()), 1e-300))
    tails = np.concatenate([node[ends[:, 0]], node])
    heads = np.concatenate([node[ends[:, 1]], np.full(n, sink)])
    capacity = np.rint(scale * np.minimum(np.concatenate([costs, to_sink]), LARGEST_SUM / scale)).astype(np.int64)
    used = (tails != heads) & (capacity > 0) & (heads != 0)
    shape = (sink + 1, sink + 1)
    graph = coo_array((capacity[used], (tails[used], heads[used])), shape=shape).tocsr()
    graph.data = np.minimum(graph.data, LARGEST_SUM).astype(np.int32)
    graph = csr_array((graph.data, graph.indices.astype(np.int32), graph.indptr.astype(np.int32)), shape=shape)
    rest = csr_array(graph - maximum_flow(graph, 0, sink, method="dinic").flow)
    rest.eliminate_zeros()
    on_source_side = np.zeros(sink + 1, dtype=bool)
    on_source_side[breadth_first_order(rest, 0, return_predecessors=False)] = True
    return on_source_side[node]
