// The transformation hierarchy: the fields that lead down it, and the transforms of nodes.
//
// All numbers are double, in metres in the coordinates around the node. Threading: the scene's thread.
// Source: ISO/IEC 19775-1 V4.0 4.3.5, 10.4.4.
#pragma once

#include <glm/mat4x4.hpp>

#include <rtsg/core/node_type.h>

namespace rtsg {

class Node;
class Scene;

/// Whether nodes in this field are below the node. Not below it are nodes that a stack points at, that a Script refers
/// to, or that are passed to a PROTO instance, whose body then holds them by IS.
bool isTransform(const NodeType& type, FieldIndex field);
/// The transform of a node. For Transform and nodes with the same fields it is T C R SR S -SR -C (10.4.4); for
/// geospatial nodes it is geoTransform(), or the identity if that has an error.
glm::dmat4 parentFromLocal(const Scene& scene, const Node& node);
/// Whether the document of a node, or one around that, was loaded by an Inline.
bool isInlined(const Scene& scene, const Node& node);

}  // namespace rtsg
