// Places: where nodes are in the world, and who must be asked again when that changes.
//
// A place is computed when it is asked for and kept until a node above it is written or hung elsewhere; then those who
// asked are told. So a frame costs what moved in it, whatever the number of things that wait. The first path from the
// root counts, unless all are asked for. Derived from the scene: no part of its state. Threading: the scene's thread.
// Source: ISO/IEC 19775-1 V4.0 4.3.5, 10.4.4 (transformation hierarchy), 7.2.2 (the bound viewpoint).
#pragma once

#include <memory>
#include <unordered_map>
#include <vector>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/placement.h>

namespace rtsg {

class WorldTransforms {
  public:
    explicit WorldTransforms(const Scene& scene) : scene_(scene) {}

    /// The transform of the node's content, with its own translation and so on. `asker` is told when it changes.
    const glm::dmat4& worldFromLocal(NodeId node, NodeId asker) { return ask(node, asker).worldFromLocal; }
    /// Whether all Switches and LODs above the node show it; `asker` is told likewise.
    bool isShown(NodeId node, NodeId asker) { return ask(node, asker).shown; }
    /// Both for all paths but the first; `asker` is told likewise.
    std::span<const Standing> otherTransforms(NodeId node, NodeId asker) { return ask(node, asker).others; }
    const Viewer& viewer(NodeId asker);

    /// A place, a view or a parent of the node has changed.
    void noteMoved(NodeId node) {
        if (isWatched(node)) moved_.push_back(node);
    }
    bool watchesAny() const { return !isWatched_.empty(); }
    /// Whether a place that somebody has asked for hangs on the node.
    bool isWatched(NodeId node) const { return node.value < isWatched_.size() && isWatched_[node.value]; }
    /// Takes the askers whose answers have changed since the last call, each once, in no order.
    void takeConcerned(std::vector<NodeId>& out);
    /// Visits all askers, some of them more than once.
    template <class F>
    void forEachAsker(const F& visit) const {
        for (const auto& [id, entry] : transforms_)
            for (const NodeId asker : entry.askers)
                if (asker != scene_.root() && scene_.find(asker)) visit(asker);
        for (const NodeId asker : viewerAskers_)
            if (scene_.find(asker)) visit(asker);
    }
    bool anyMoved() const { return !moved_.empty(); }
    /// Forgets everything.
    void clear();

  private:
    struct Entry {
        glm::dmat4 worldFromLocal{1};
        bool known = false, shown = true;
        std::vector<Standing> others;
        std::uint32_t version = 0;   // of the path
        std::vector<NodeId> path;    // up to, and without, the root; with the GeoOrigins that count; of all paths
        std::vector<NodeId> askers;  // who asked since it became known
    };
    struct Passer {
        NodeId entry;
        std::uint32_t version = 0;
    };
    struct Passers {
        std::vector<Passer> list;  // the places whose paths lead through a node; old versions are rubbish
        std::size_t cleaned = 0;
    };
    /// A path, from the node up to `at` so far.
    struct Ancestry {
        NodeId at;
        Standing standing;
    };
    const Entry& ask(NodeId node, NodeId asker);
    void compute(NodeId id, Entry& entry);
    void climb(Ancestry& ancestry, std::vector<NodeId>& path, std::vector<Ancestry>& ancestries) const;
    void watch(NodeId node);
    void computeViewer();

    const Scene& scene_;
    std::unordered_map<std::uint32_t, Entry> transforms_;
    std::unordered_map<std::uint32_t, Passers> passers_;
    std::vector<std::uint8_t> isWatched_;  // by NodeId; bytes, as it is looked at with every move
    std::vector<NodeId> moved_;
    Viewer viewer_;
    bool viewerKnown_ = false;
    NodeId viewerLayer_;  // whose viewpoint is the viewer's
    std::vector<NodeId> viewerAskers_;
    std::vector<bool> asksViewer_;  // by NodeId
};

/// Whether an output names nodes that stand elsewhere (such as a sensor's picked nodes), and so leads nowhere down the
/// hierarchy.
bool onlyReports(const NodeType& type, FieldIndex field);
/// The turn in a matrix, without its scale and shear.
glm::dquat rotationPart(const glm::dmat4& matrix);
/// Whether some path leads up from the node to the root.
bool isInScene(const Scene& scene, NodeId id);
/// One of the tables' own, which has binding stacks.
bool isLayer(const Node& node);
/// The layer that the node is in, on the first path up; the root if it is in none; null if it is not in the
/// scene.
const Node* layerOf(const Scene& scene, NodeId id);
/// The node that is bound in the active layer's stack of this name; null if none is.
const Node* topOfStack(const Scene& scene, std::string_view stack);

}  // namespace rtsg
