// Keeps the table from numbers to nodes: decides which ranges of numbers get a page.
#include "node_table.h"

#include <algorithm>

namespace rtsg {

Node* NodeTable::findScattered(NodeId id) const {
    const auto found = scattered_.find(id.value);
    return found == scattered_.end() ? nullptr : found->second;
}

bool NodeTable::mayHave(std::uint32_t page) const {
    return page < kAlwaysDirectory + kDirectoryPerNode * size_ && pagesInUse_ < kAlwaysPages + size_ / kNodesPerPage;
}

void NodeTable::makePage(std::uint32_t page) {
    if (page >= pages_.size()) {
        pages_.resize(page + 1);
        counts_.resize(page + 1);
    }
    pages_[page] = static_cast<Node**>(memory_.allocate(kPage * sizeof(Node*)));
    std::fill_n(pages_[page], kPage, nullptr);
    ++pagesInUse_;
    const auto first = scattered_.lower_bound(page * kPage);
    auto last = first;
    for (; last != scattered_.end() && last->first / kPage == page; ++last) {
        pages_[page][last->first % kPage] = last->second;
        ++counts_[page];
    }
    scattered_.erase(first, last);
}

/// In a page of its own, or scattered.
void NodeTable::addElsewhere(NodeId id, Node& node) {
    const std::uint32_t page = id.value / kPage;
    ++size_;
    if (!mayHave(page)) {
        scattered_.emplace(id.value, &node);
        return;
    }
    makePage(page);
    pages_[page][id.value % kPage] = &node;
    ++counts_[page];
}

void NodeTable::remove(NodeId id, NodeId next) {
    const std::uint32_t page = id.value / kPage;
    --size_;
    if (page >= pages_.size() || !pages_[page]) {
        scattered_.erase(id.value);
        return;
    }
    pages_[page][id.value % kPage] = nullptr;
    if (--counts_[page] > 0 || page == next.value / kPage) return;
    memory_.deallocate(pages_[page], kPage * sizeof(Node*));
    pages_[page] = nullptr;
    --pagesInUse_;
}

}  // namespace rtsg
