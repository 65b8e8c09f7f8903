// OutputNode: a node of the document that a reader writes; it is closed at the end of its block.
//
// Threading: one thread a document.
#pragma once

#include <string_view>
#include <utility>

#include <rtsg/documents/document_handler.h>

namespace rtsg::detail {

class OutputNode {
  public:
    OutputNode(DocumentHandler& out, std::string_view type, std::string_view field = {}, std::string_view def = {},
               SourceLocation where = {})
        : out_(out), where_(where) {
        out_.beginNode(type, def, field, where);
    }
    ~OutputNode() { out_.endNode(where_); }
    OutputNode(const OutputNode&) = delete;
    OutputNode& operator=(const OutputNode&) = delete;

    template <class T>
    void set(std::string_view field, T value) {
        out_.setField(field, Value(std::move(value)), where_);
    }
    void is(std::string_view field, std::string_view protoField) { out_.isConnection(field, protoField, where_); }

  private:
    DocumentHandler& out_;
    SourceLocation where_;
};

}  // namespace rtsg::detail
