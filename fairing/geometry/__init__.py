"""Geometry of meshes, without photos.

What belongs here: rasterization (`rasterize`), closest points on a surface (`closest_point`) and on single triangles
(`triangles`), face normals and quality (`normals`), normal filtering (`normal_filter`), sets of vertices without a common face
(`independent_sets`) and mesh inspection (`mesh_check`).

May import: the data modules of `fairing` and `fairing.util`.

Offers: `rasterize`, `SurfaceTree`, `closest_on_triangles`, `barycentric`, `face_normals`, `face_quality`,
`folded_faces`, `smoothed`, `inspect_mesh`.
"""
