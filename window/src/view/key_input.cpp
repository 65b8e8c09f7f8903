// Pairs keys with the text that they write.
#include "key_input.h"

#include <utility>

namespace rtsg {

namespace {

/// The one character that the text is, if it is one.
std::optional<char32_t> onlyCharacter(const std::string& text) {
    if (text.empty()) return std::nullopt;
    const auto lead = static_cast<unsigned char>(text[0]);
    const std::size_t length = lead < 0x80 ? 1 : lead < 0xE0 ? 2 : lead < 0xF0 ? 3 : 4;
    if (text.size() != length) return std::nullopt;
    if (length == 1) return lead;
    char32_t code = lead & (0x7FU >> length);
    for (std::size_t i = 1; i < length; ++i) code = code << 6 | (static_cast<unsigned char>(text[i]) & 0x3FU);
    return code;
}

std::optional<KeyInput> withoutText(const WindowEvent& event) {
    using Key = WindowEvent::Key;
    KeyInput input;
    input.down = event.down;
    if (event.functionKey > 0) {
        input.action = static_cast<ActionKey>(static_cast<int>(ActionKey::f1) + event.functionKey - 1);
        return input;
    }
    switch (event.key) {
        case Key::enter:
            input.character = U'\n';
            break;
        case Key::backspace:
            input.character = U'\b';
            break;
        case Key::tab:
            input.character = U'\t';
            break;
        case Key::home:
            input.action = ActionKey::home;
            break;
        case Key::end:
            input.action = ActionKey::end;
            break;
        case Key::pageUp:
            input.action = ActionKey::pageUp;
            break;
        case Key::pageDown:
            input.action = ActionKey::pageDown;
            break;
        case Key::up:
            input.action = ActionKey::up;
            break;
        case Key::down:
            input.action = ActionKey::down;
            break;
        case Key::left:
            input.action = ActionKey::left;
            break;
        case Key::right:
            input.action = ActionKey::right;
            break;
        case Key::shift:
            input.action = ActionKey::shift;
            break;
        case Key::control:
            input.action = ActionKey::control;
            break;
        case Key::alt:
            input.action = ActionKey::alt;
            break;
        default:
            return std::nullopt;
    }
    return input;
}

}  // namespace

std::vector<KeyInput> KeyTranslator::take(const WindowEvent& event) {
    std::vector<KeyInput> heard;
    if (event.kind == WindowEvent::Kind::text) {
        const auto character = onlyCharacter(event.text);
        if (const auto key = std::exchange(pending_, std::nullopt); key && character) {
            characters_[*key] = *character;
            heard.push_back({true, *character, ActionKey::none});
        } else {
            text_ += event.text;
        }
        return heard;
    }
    if (event.repeats) return heard;
    if (const auto input = withoutText(event)) {
        heard.push_back(*input);
        return heard;
    }
    const char32_t key = event.key == WindowEvent::Key::space ? U' ' : event.character;
    if (key == 0) return heard;
    if (event.down) {
        pending_ = key;
    } else if (const auto known = characters_.find(key); known != characters_.end()) {
        heard.push_back({false, known->second, ActionKey::none});
        characters_.erase(known);
    }
    return heard;
}

std::string KeyTranslator::takeText() {
    return std::exchange(text_, {});
}

}  // namespace rtsg
