// XmlTree: a small XML file of another program as a tree of elements with their places.
//
// Invariant: an element stands behind the one that holds it, so a tree of any depth is walked without recursion.
// Namespaces are left as they are written. Threading: one thread a tree.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg::detail {

struct XmlElement {
    std::string name;
    std::vector<std::pair<std::string, std::string>> attributes;
    SourceLocation where;
    std::string text;                     // without white space at its ends; what stands between children is joined
    std::vector<std::uint32_t> children;  // their numbers in the tree

    /// Null: it has none of that name.
    const std::string* attribute(std::string_view wanted) const;
};

class XmlTree {
  public:
    /// False, and reported, if the text is not well-formed or has more than a million elements.
    bool read(std::string_view text, Diagnostics& diagnostics);

    const XmlElement& root() const { return elements_.front(); }
    const std::vector<XmlElement>& elements() const { return elements_; }
    /// Calls `see` with each child of that name, in order.
    template <class See>
    void forEach(const XmlElement& parent, std::string_view name, const See& see) const {
        for (const std::uint32_t child : parent.children)
            if (elements_[child].name == name) see(elements_[child]);
    }
    /// The first child of that name; null: there is none.
    const XmlElement* child(const XmlElement& parent, std::string_view name) const;

  private:
    std::vector<XmlElement> elements_;
};

}  // namespace rtsg::detail
