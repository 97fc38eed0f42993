//! Triangle meshes: the vertices of a point file with the faces between them.

use std::path::Path;

use crate::bytes::read_bytes;
use crate::error::{Fault, FileError, Flaw};
use crate::formats::{obj, ply, stl};
use crate::options::{Invalid, ReadOptions};
use crate::read::{choose, read_as, unpacked};

/// Vertices and triangles of a file; without triangles it is a cloud.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    /// Vertices, in the units of the file.
    pub vertices: Vec<[f64; 3]>,
    /// Indices of three vertices each, from 0.
    pub triangles: Vec<[usize; 3]>,
}

/// Read a mesh: faces of `.obj`, `.ply` and `.stl` files, polygons split into fans; other formats hold points alone.
///
/// # Errors
/// [`FileError`]: as [`crate::read_points`], points that are not 3-D, and faces that name no vertex.
///
/// ```
/// use cfpose_vision::read_mesh;
/// let path = std::env::temp_dir().join(format!("cfpose-mesh-{}.obj", std::process::id()));
/// std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2/7 3//9 4\nf -1 -2 -3\n")?;
/// let mesh = read_mesh(&path)?;
/// assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [3, 2, 1]]);
/// # std::fs::remove_file(&path)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_mesh(path: &Path) -> Result<Mesh, FileError> {
    let fail = |flaw: Flaw| flaw.in_file(path);
    // Faces count vertices as they stand in the file, so none may be skipped.
    let options = ReadOptions { invalid: Invalid::Refuse, ..ReadOptions::default() };
    let format = choose(path, &options).map_err(|fault| fail(fault.into()))?;
    let bytes = read_bytes(path).map_err(|fault| fail(fault.into()))?;
    let points = read_as(format, &bytes, &options).map_err(fail)?.points;
    let bytes = unpacked(&bytes).map_err(|fault| fail(fault.into()))?;
    if points.dim() != 3 {
        let what = format!("a mesh of points with {} coordinate(s)", points.dim());
        return Err(fail(Fault::Unsupported { what, advice: "give points with x, y and z" }.into()));
    }
    let triangles = match format.name {
        "obj" => obj::triangles(&bytes, points.len()),
        "ply" => ply::triangles(&bytes, points.len()),
        "stl" => stl::triangles(&bytes, points.len()),
        _ => Ok(Vec::new()),
    };
    let vertices = (0..points.len()).map(|k| points.point(k)).collect();
    Ok(Mesh { vertices, triangles: triangles.map_err(fail)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(name: &str, bytes: &[u8]) -> Result<Mesh, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        read_mesh(&path).map_err(|error| error.to_string().split_once(": ").unwrap().1.to_string())
    }

    const PLY: &str = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                       element face 2\nproperty uchar flags\nproperty list uchar int vertex_indices\nend_header\n";

    #[test]
    fn ply_faces_are_read_in_every_encoding() {
        let corners = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.5]];
        let ascii = format!("ply\nformat ascii 1.0\n{PLY}0 0 0\n1 0 0\n\n1 1 0\n0 1 .5\n7 4 0 1 2 3\n7 3 3 1 2\n");
        let expected = read("a.ply", ascii.as_bytes()).unwrap();
        assert_eq!(expected.triangles, [[0, 1, 2], [0, 2, 3], [3, 1, 2]]);
        assert_eq!(expected.vertices[3], [0.0, 1.0, 0.5]);
        for (name, big) in [("little", false), ("big", true)] {
            let mut bytes = format!("ply\nformat binary_{name}_endian 1.0\n{PLY}").into_bytes();
            let float = |v: f32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
            let int = |v: i32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
            bytes.extend(corners.iter().flatten().flat_map(|v| float(*v)));
            for polygon in [&[0, 1, 2, 3][..], &[3, 1, 2]] {
                bytes.extend([7, polygon.len() as u8]);
                bytes.extend(polygon.iter().flat_map(|i| int(*i)));
            }
            assert_eq!(read("b.ply", &bytes).unwrap(), expected, "{name}");
        }
    }

    #[test]
    fn faces_that_name_no_vertex_are_refused_where_they_stand() {
        let ply = |faces: &str| {
            read("a.ply", format!("ply\nformat ascii 1.0\n{PLY}0 0 0\n1 0 0\n1 1 0\n0 1 0\n{faces}").as_bytes())
        };
        // Ten lines of header and four vertices stand before the first face.
        assert_eq!(
            ply("0 3 0 1 4\n0 3 0 1 2\n").unwrap_err(),
            "line 15: the face names vertex number 5, of 4; write the mesh again"
        );
        assert!(ply("0 3 0 1 2\n0 3 0 1 -1\n").unwrap_err().starts_with("line 16: the face has the index \"-1\""));
        let obj = |face: &str| read("a.obj", format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{face}\n").as_bytes());
        assert!(obj("f 1 2 9").unwrap_err().starts_with("line 4: the face names vertex number 9, of 3"));
        assert!(obj("f 1 2 0").unwrap_err().starts_with("line 4: the face has the index \"0\""));
        assert!(obj("f 1 2 -4").unwrap_err().starts_with("line 4: the face has the index \"-4\""));
        assert!(obj("f 1 2 x").unwrap_err().starts_with("line 4: the face has the index \"x\""));
        assert!(obj("").unwrap().triangles.is_empty());
        assert!(read("a.csv", b"1,2\n3,4\n").unwrap_err().contains("2 coordinate(s)"));
    }
}
