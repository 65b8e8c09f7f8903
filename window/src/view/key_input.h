// Turns what a window tells of its keyboard into key input of a scene.
//
// A key that writes something is told twice by windows: as a key, and as the text that it writes with the modifiers of
// the moment. Scenes hear of it once, as a key with that character (19775-1, 21.4.1), whose release names the same one.
// Text without a key, composed or pasted, is text. Threading: one thread.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/core/device_input.h>

#include "window_module.h"

namespace rtsg {

class KeyTranslator {
  public:
    /// The scene's inputs for an event of kind key or text. Repetitions of a key give its text only.
    std::vector<KeyInput> take(const WindowEvent& event);
    /// Text that belongs to no key, since the last call.
    std::string takeText();

  private:
    std::optional<char32_t> pending_;          // pressed, its text is still to come
    std::map<char32_t, char32_t> characters_;  // of keys that are down: the characters that they wrote
    std::string text_;
};

}  // namespace rtsg
