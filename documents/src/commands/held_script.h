// A Script or shader in the body of a PROTO, held back until its end: an IS may connect fields before or behind their
// declarations, and handlers hear of a connection directly behind the declaration.
//
// Invariant: whatever the order in the file, the same commands result, in the file's order except for connections.
// Scripts in node-valued fields of the Script are included. Threading: one thread a document.
#pragma once

#include <cstddef>
#include <string>
#include <unordered_map>
#include <vector>

#include <rtsg/documents/command_list.h>

namespace rtsg::detail {

class HeldScript {
  public:
    /// Field of the node to fields of the PROTO.
    using Connections = std::unordered_map<std::string, std::vector<std::string>>;

    explicit HeldScript(DocumentHandler& next) : next_(next) {}

    CommandList& commands() { return commands_; }
    DocumentHandler& next() const { return next_; }
    /// To be called for each node that begins in it, itself the first; returns its number.
    std::size_t count() { return nodes_++; }
    /// Keeps the IS connections of the declared fields of the node with that number.
    void connect(std::size_t node, Connections connections) { connections_.emplace(node, std::move(connections)); }
    void report() const;

  private:
    DocumentHandler& next_;
    CommandList commands_;
    std::size_t nodes_ = 0;
    std::unordered_map<std::size_t, Connections> connections_;
};

}  // namespace rtsg::detail
