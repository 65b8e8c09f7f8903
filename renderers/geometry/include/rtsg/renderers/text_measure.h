// measureText: the size of a Text with the fonts of this machine.
//
// Threading: any thread that may read the scene. Source: ISO/IEC 19775-1 V4.0 15.4.2 (lineBounds, origin, textBounds).
// The clause leaves the height of a line open: here it goes from the font's descent to its ascent, whatever the
// letters, and a column is one em wide; so while somebody types, the result changes only with a line's width.
#pragma once

#include <rtsg/core/scene.h>

namespace rtsg {

/// A TextMeasure (rtsg/documents/scene_builder.h), in the units of the Text; for a ScreenFontStyle in pixels. Empty if
/// there are no lines, no fonts, or sizes that cannot be drawn. Precondition: `text` is a Text.
Array<float> measureText(const Scene& scene, const Node& text);

}  // namespace rtsg
