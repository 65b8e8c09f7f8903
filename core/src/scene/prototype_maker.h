// Instances of prototypes that are made by name while the scene runs.
//
// The scene knows a prototype as a type with the text of its declaration; who reads documents, in document/, makes the
// body out of it. Threading: the scene's thread.
#pragma once

#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>

namespace rtsg::detail {

/// An instance with its body, in no field of any node. `type`: a PROTO or EXTERNPROTO that a document declares.
/// `resources`: what urls in it may open; null: nothing. Errors: what the declaration's text says against it.
Result<NodeId> makePrototypeInstance(Scene& scene, TypeIndex type, NodeId scope, const Resources* resources);

}  // namespace rtsg::detail
