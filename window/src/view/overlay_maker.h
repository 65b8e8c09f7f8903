// Makes the overlay's content for a scene: its viewpoints, the opened part of its tree, and the node that is picked.
//
// Invariant: the work of a call depends on what is shown. Work that needs the whole scene (its viewpoints, its
// triangles) is done so seldom that it takes a fiftieth of the time. Threading: the scene's thread.
#pragma once

#include <chrono>
#include <set>
#include <string>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/renderers/shared_world.h>

#include "overlay_content.h"

namespace rtsg {

class OverlayMaker {
  public:
    explicit OverlayMaker(SharedWorld& world) : world_(world) {}

    /// Fills in the viewpoints.
    void fillViewpoints(OverlayContent& content);
    /// Fills in the tree and the picked node.
    void fill(OverlayContent& content);
    /// Opens or closes a row of the tree.
    void toggle(NodeId node);
    void pick(NodeId node) { picked_ = node; }
    NodeId picked() const { return picked_; }
    /// Opens the tree at the picked path, which begins at a root node: at the innermost node with a name, or else at
    /// the last.
    void pickOnPath(const std::vector<NodeId>& path);
    /// Triangles along all paths.
    std::size_t triangles() const { return triangles_; }

  private:
    using Clock = std::chrono::steady_clock;
    void lookAtAll();
    void addRows(const std::vector<NodeId>& nodes, int depth, std::vector<OverlayContent::Row>& rows) const;
    OverlayContent::Picked describe(const Node& node) const;

    SharedWorld& world_;
    std::set<NodeId> open_;
    NodeId picked_;
    std::size_t triangles_ = 0;
    std::vector<NodeId> viewpoints_;
    Clock::time_point due_{};
};

}  // namespace rtsg
