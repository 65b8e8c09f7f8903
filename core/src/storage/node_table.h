// NodeTable: from a node's number to the node.
//
// Numbers given in order fill pages of 1,024, which are found with two reads. A set from a file or a peer may leave
// gaps as it likes, and so does a session that has run for long: pages are made only as long as there are few for the
// nodes there are, and what lies outside is kept in a tree. Invariant: a page that exists holds all nodes of its range.
// Memory is at most 160 bytes a node and 2 MiB, whatever the numbers. Threading: one thread.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include <rtsg/core/value.h>

#include "node_arena.h"

namespace rtsg {

class Node;

class NodeTable {
  public:
    static constexpr std::uint32_t kPage = 1024;

    explicit NodeTable(NodeArena& memory) : memory_(memory) {}

    Node* find(NodeId id) const { return view().find(id); }
    /// For many look-ups: its members stay in registers whatever is written in between. Valid until a node is added or
    /// removed.
    struct View {
        Node* const* const* pages;
        std::size_t count;
        const NodeTable* table;
        Node* find(NodeId id) const {
            const std::uint32_t page = id.value / kPage;
            if (page < count && pages[page]) return pages[page][id.value % kPage];
            return table->scattered_.empty() ? nullptr : table->findScattered(id);
        }
    };
    View view() const { return {pages_.data(), pages_.size(), this}; }
    void prefetch(NodeId id) const {
        const std::uint32_t page = id.value / kPage;
        if (page < pages_.size() && pages_[page]) __builtin_prefetch(&pages_[page][id.value % kPage]);
    }
    /// Precondition: there is none of this number.
    void add(NodeId id, Node& node) {
        const std::uint32_t page = id.value / kPage;
        if (page >= pages_.size() || !pages_[page]) return addElsewhere(id, node);
        ++size_;
        pages_[page][id.value % kPage] = &node;
        ++counts_[page];
    }
    /// Precondition: it is there. A page that is empty then goes, unless `next`, the number to be given next, is in it.
    void remove(NodeId id, NodeId next);
    std::size_t size() const { return size_; }

    /// In the order of numbers. `visit` may remove nodes, not add any.
    template <class Visit>
    void forEach(const Visit& visit) const {
        auto rest = scattered_.begin();
        for (std::uint32_t page = 0; page < pages_.size(); ++page) {
            if (!pages_[page]) continue;
            while (rest != scattered_.end() && rest->first / kPage < page) visit(*(rest++)->second);
            for (std::uint32_t i = 0; pages_[page] && i < kPage; ++i)
                if (pages_[page][i]) visit(*pages_[page][i]);
        }
        while (rest != scattered_.end()) visit(*(rest++)->second);
    }

  private:
    static constexpr std::uint32_t kAlwaysDirectory = 1u << 16, kDirectoryPerNode = 1;
    static constexpr std::uint32_t kAlwaysPages = 16, kNodesPerPage = 64;

    Node* findScattered(NodeId id) const;
    void addElsewhere(NodeId id, Node& node);
    bool mayHave(std::uint32_t page) const;
    void makePage(std::uint32_t page);

    NodeArena& memory_;
    std::vector<Node**> pages_;  // of kPage nodes each; null while there is none
    std::vector<std::uint32_t> counts_;
    std::size_t pagesInUse_ = 0, size_ = 0;
    std::map<std::uint32_t, Node*> scattered_;  // not a hash table: whoever sends numbers could have them collide
};

}  // namespace rtsg
