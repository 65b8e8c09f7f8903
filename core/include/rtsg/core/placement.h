// How nodes stand in the transformation hierarchy: which fields lead down it, and how a node moves what is below it.
//
// All in double, metres in the coordinates around the node. Threading: the scene's thread.
// Source: ISO/IEC 19775-1 V4.0 4.3.5, 10.4.4.
#pragma once

#include <glm/mat4x4.hpp>

#include <rtsg/core/node_type.h>

namespace rtsg {

class Node;
class Scene;

/// Whether nodes in this field are below the node: not those that a stack points at, that a Script refers to, or that
/// are handed to a PROTO instance, whose body then holds them by IS.
bool isPlace(const NodeType& type, FieldIndex field);
/// 10.4.4, of Transform and all that have the like: T C R SR S -SR -C; of geospatial nodes as geoPlace() says, and
/// the identity where that has an error.
glm::dmat4 parentFromLocal(const Scene& scene, const Node& node);
/// Whether the document that a node stands in, or one around that, is an Inline's.
bool isInlined(const Scene& scene, const Node& node);

}  // namespace rtsg
