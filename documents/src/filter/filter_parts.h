// Filters that have files of their own; makeFilter() finds them by name.
//
// Threading: one thread a stream.
#pragma once

#include <memory>
#include <string_view>

#include <rtsg/documents/filters.h>

namespace rtsg::detail {

using FilterPtr = std::unique_ptr<DocumentHandler>;

/// Leaves out "comments" (and what authors say about declarations), "defaults" (values of built-in nodes' fields that
/// are the fields' defaults), "metadata" (metadata nodes, WorldInfo and META), "names" (that nothing refers to) or
/// "scripts" (and the routes to and from them).
FilterPtr makeDropFilter(std::string_view what, DocumentHandler& next);
/// Renames DEFs to n1, n2, ... in the order in which they appear.
FilterPtr makeShortNames(DocumentHandler& next);
/// Replaces each number of fields of floats by the shortest decimal that is at most `error` away.
FilterPtr makeQuantise(double error, DocumentHandler& next);
/// Renames as "OLD:NEW,OLD:NEW" says, in the document and not within prototypes.
Result<FilterPtr> makeRename(std::string_view pairs, DocumentHandler& next, Diagnostics& diagnostics);
/// Materials with metadata of reflection and refraction become instances of portable materials.
FilterPtr makePortable(DocumentHandler& next, Diagnostics& diagnostics);
/// Keeps the nodes whose DEF or type is among "NAME,NAME", with all that is in them.
Result<FilterPtr> makeSelect(std::string_view names, DocumentHandler& next, Diagnostics& diagnostics);
/// Puts the document into other units, "length:0.001,angle:0.0174"; into those of the standard if there are none.
Result<FilterPtr> makeUnits(std::string_view units, DocumentHandler& next);
/// Reports statistics of the document.
FilterPtr makeStatistics(DocumentHandler& next, Diagnostics& diagnostics);
/// Nodes that are equal, names aside, become one node that is used again.
FilterPtr makeShareNodes(DocumentHandler& next);
/// Points, colours, normals and texture coordinates that are equal become one; triangles without indices get some.
FilterPtr makeIndex(DocumentHandler& next);
/// Transforms that nothing moves go into the coordinates below them, or become one.
FilterPtr makeFlattenTransforms(DocumentHandler& next);
/// Replaces instances of prototypes by their nodes, or Inlines by Groups with their content.
FilterPtr makeFlattenProtos(DocumentHandler& next, const FilterContext& context);
FilterPtr makeFlattenInlines(DocumentHandler& next, const FilterContext& context);
/// Inlines become Groups with their content, and InlineGeometry the geometry that it names, loaded or not.
FilterPtr makeEmbed(DocumentHandler& next, const FilterContext& context);

}  // namespace rtsg::detail
