// DocumentMatch: pairs the nodes of an edited document with those of the document before.
//
// Nodes are paired by their DEF names first; then children by their places in paired parents, where children with
// identical contents come first; then the remaining nodes that have moved, if exactly one other node is identical.
// Invariant: paired nodes have the same type and lie in paired scopes; none is in two pairs. The cost grows with both
// documents, and by a logarithm more where lists were edited. Threading: the scenes' thread, during construction.
#pragma once

#include <cstdint>
#include <deque>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include <rtsg/core/scene.h>

namespace rtsg {

/// Whether a document decides the field: not whoever runs the scene.
bool isOfDocument(const NodeType& type, const FieldDef& field);
/// A node's nodes in one field.
std::vector<NodeId> nodesIn(const Node& node, FieldIndex field);
/// The name under which a document declares a type: `Name` of `Name#2`, the second of that name in the scene.
std::string_view nameInDocument(const NodeType& type);
/// Whether both are the same to a document that uses them, in whatever scenes they are.
bool isSameType(const NodeType& a, const NodeType& b);

class DocumentMatch {
  public:
    /// Both as they were read: no frame has run since.
    DocumentMatch(const Scene& before, const Scene& after);
    /// The node's pair; none: it is new.
    NodeId before(NodeId after) const { return of(before_, after); }
    /// The node's pair; none: it is gone.
    NodeId after(NodeId before) const { return of(after_, before); }

  private:
    using Nodes = std::vector<NodeId>;
    using Partners = std::vector<NodeId>;        // by node number
    using Digests = std::vector<std::uint64_t>;  // by node number
    static NodeId of(const Partners& partners, NodeId id) {
        return id.value < partners.size() ? partners[id.value] : NodeId{};
    }
    static Digests digestsOf(const Scene& scene);

    bool mayPair(NodeId before, NodeId after) const;
    bool isEqual(NodeId before, NodeId after) const;
    bool pair(NodeId before, NodeId after);
    void descend();
    void alignBelow(NodeId before, NodeId after);
    void align(std::span<const NodeId> before, std::span<const NodeId> after);
    void alignGap(std::span<const NodeId> before, std::span<const NodeId> after);
    std::uint64_t tokenOf(NodeId pairedWith, std::uint64_t digest) const;
    std::vector<std::pair<std::size_t, std::size_t>> commonRun(std::span<const NodeId> before,
                                                               std::span<const NodeId> after) const;
    int likeness(NodeId before, NodeId after) const;
    void pairElsewhere();
    void partUnequalConnections();

    const Scene &beforeScene_, &afterScene_;
    Digests beforeDigests_, afterDigests_;
    std::vector<TypeIndex> typeBefore_;  // by number of the type after
    Partners before_, after_;
    std::unordered_map<std::uint32_t, Nodes> named_;        // of the scene after, by scope
    std::unordered_map<std::uint32_t, Nodes> looseBefore_;  // without a parent, by scope
    std::unordered_map<std::uint32_t, Nodes> looseAfter_;
    std::deque<std::pair<NodeId, NodeId>> waiting_;  // pairs whose children have not been looked at
};

}  // namespace rtsg
