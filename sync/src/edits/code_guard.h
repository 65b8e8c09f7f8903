// Tells which changes of a peer could make the origin open a file or run a program (PROTOCOL.md, "Upstream").
//
// These are urls, what else starts a load (X3DUrlObject's load and refresh times), fields from which routes or IS
// connections pass a value on to one of those, and whatever belongs to a Script. It is told from the tables of node
// types, so that new nodes and PROTOs are covered. An input that the author has connected to a Script is open to peers
// as any other: the author's program then runs, with a value of theirs.
// Invariant: a peer without MirrorUpstream::code changes none of them, whatever it sends in whatever order.
// Threading: on the scene's thread.
#pragma once

#include <string>
#include <unordered_set>

#include <rtsg/core/scene.h>

namespace rtsg::mirror {

bool isScript(const NodeType& type);
/// "Inline.url" if a change of the field makes the origin open a file, else empty.
std::string nameIfLoading(const NodeType& type, FieldIndex field);

/// For one request: remembers what it has looked at, so that all its changes together cost one walk over the routes.
class CodeGuard {
  public:
    explicit CodeGuard(const Scene& scene) : scene_(scene) {}
    /// Name of the first field of that kind that a value would reach from this one; empty if there is none.
    std::string reachedFrom(NodeId node, FieldIndex field);

  private:
    const Scene& scene_;
    std::unordered_set<std::uint64_t> harmless_;  // fields that lead to nothing guarded
};

}  // namespace rtsg::mirror
