//! Polygons as triangles.

use crate::error::Fault;

/// Split a polygon into the triangles around its first vertex and check its indices.
pub(crate) fn push_fan(triangles: &mut Vec<[usize; 3]>, polygon: &[usize], num_vertices: usize) -> Result<(), Fault> {
    if let Some(wrong) = polygon.iter().find(|index| **index >= num_vertices) {
        let what = format!("the face names vertex number {}, of {num_vertices}", wrong.saturating_add(1));
        return Err(Fault::Face { what });
    }
    triangles.extend(polygon.windows(2).skip(1).map(|pair| [polygon[0], pair[0], pair[1]]));
    Ok(())
}
