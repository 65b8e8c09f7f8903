// measureText: how large a Text is with the fonts of this machine.
//
// Threading: any thread that may read the scene. Source: ISO/IEC 19775-1 V4.0 15.4.2 (lineBounds, origin, textBounds).
// The clause leaves open what a line's height is: here it is from the font's descent to its ascent, whatever letters
// there are, and of a column one em wide; so what is told changes with a line's width alone as one types.
#pragma once

#include <rtsg/core/scene.h>

namespace rtsg {

/// A TextMeasure (rtsg/documents/scene_builder.h), in the units of the Text; of a ScreenFontStyle in pixels. Empty
/// where there are no lines, no fonts, or sizes that cannot be drawn. Precondition: `text` is a Text.
Array<float> measureText(const Scene& scene, const Node& text);

}  // namespace rtsg
