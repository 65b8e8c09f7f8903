// Filters that have files of their own; makeFilter() finds them by name.
//
// Threading: one thread a stream.
#pragma once

#include <memory>

#include <rtsg/core/filter.h>

namespace rtsg::detail {

/// Leaves out comments and what authors say about declarations.
std::unique_ptr<DocumentHandler> makeDropComments(DocumentHandler& next);
/// Leaves out the values of built-in nodes' fields that are the fields' defaults.
std::unique_ptr<DocumentHandler> makeDropDefaults(DocumentHandler& next);
/// Replaces each number of fields of floats by the shortest decimal that is at most `error` away.
std::unique_ptr<DocumentHandler> makeQuantise(double error, DocumentHandler& next);

}  // namespace rtsg::detail
