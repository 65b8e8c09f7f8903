// CodeGuard: tells which changes of a peer could make the origin open a file or run a program (PROTOCOL.md,
// "Upstream").
//
// Such are urls, other fields that start a load (X3DUrlObject's load and refresh times), fields that pass a value on to
// these by routes or IS connections, and everything of a Script. It uses the tables of node types, so it covers new
// nodes and PROTOs. An input that the author has connected to a Script is open to peers like any other; the author's
// program then runs with their value.
// Invariant: a peer without MirrorUpstream::code changes none of these, whatever it sends and in whatever order.
// Threading: the scene's thread.
#pragma once

#include <string>
#include <unordered_set>

#include <rtsg/core/scene.h>

namespace rtsg::mirror {

bool isScript(const NodeType& type);
/// "Inline.url", say, if a change of the field makes the origin open a file; else empty.
std::string nameIfLoading(const NodeType& type, FieldIndex field);

/// For one request. It remembers what it has looked at, so that all changes together cost one walk over the routes.
class CodeGuard {
  public:
    explicit CodeGuard(const Scene& scene) : scene_(scene) {}
    /// The name of the first such field that a value would reach from this field. Empty if there is none.
    std::string reachedFrom(NodeId node, FieldIndex field);

  private:
    const Scene& scene_;
    std::unordered_set<std::uint64_t> harmless_;  // fields that lead to no guarded field
};

}  // namespace rtsg::mirror
