// Keys and the text that they write, as a window tells of them and as scenes are to hear of them.
#include <gtest/gtest.h>

#include "view/key_input.h"

namespace rtsg {
namespace {

WindowEvent key(char32_t character, bool down, bool repeats = false) {
    WindowEvent event;
    event.kind = WindowEvent::Kind::key;
    event.character = character, event.down = down, event.repeats = repeats;
    return event;
}
WindowEvent special(WindowEvent::Key which, bool down) {
    WindowEvent event;
    event.kind = WindowEvent::Kind::key;
    event.key = which, event.down = down;
    return event;
}
WindowEvent text(const char* utf8) {
    WindowEvent event;
    event.kind = WindowEvent::Kind::text;
    event.text = utf8;
    return event;
}

TEST(KeyInputOfAWindow, AKeyIsHeardOnceAsWhatItWrites) {
    KeyTranslator keys;
    EXPECT_TRUE(keys.take(key(U'a', true)).empty()) << "its text is still to come";
    const auto pressed = keys.take(text("A"));  // with shift
    ASSERT_EQ(pressed.size(), 1u);
    EXPECT_EQ(pressed[0].character, U'A');
    EXPECT_TRUE(pressed[0].down);
    EXPECT_EQ(keys.takeText(), "");
    const auto released = keys.take(key(U'a', false));
    ASSERT_EQ(released.size(), 1u);
    EXPECT_EQ(released[0].character, U'A') << "the same one, whatever shift is now";
    EXPECT_FALSE(released[0].down);
    EXPECT_TRUE(keys.take(key(U'a', false)).empty());
}

TEST(KeyInputOfAWindow, CharactersOfSeveralBytesAreOne) {
    for (const auto& [utf8, code] :
         {std::pair{"\xC3\xA9", U'\u00E9'}, {"\xE2\x82\xAC", U'\u20AC'}, {"\xF0\x9F\x98\x80", U'\U0001F600'}}) {
        KeyTranslator keys;
        (void)keys.take(key(U'e', true));
        const auto pressed = keys.take(text(utf8));
        ASSERT_EQ(pressed.size(), 1u) << utf8;
        EXPECT_EQ(pressed[0].character, code);
    }
}

TEST(KeyInputOfAWindow, WhatIsComposedPastedOrRepeatedIsText) {
    KeyTranslator keys;
    EXPECT_TRUE(keys.take(text("\xE4\xBD\xA0\xE5\xA5\xBD")).empty());
    EXPECT_EQ(keys.takeText(), "\xE4\xBD\xA0\xE5\xA5\xBD");
    (void)keys.take(key(U'x', true));
    (void)keys.take(text("x"));
    EXPECT_TRUE(keys.take(key(U'x', true, true)).empty());
    EXPECT_TRUE(keys.take(text("x")).empty());
    EXPECT_EQ(keys.takeText(), "x");
}

TEST(KeyInputOfAWindow, KeysWithoutTextAreActionKeys) {
    using Key = WindowEvent::Key;
    KeyTranslator keys;
    for (const auto& [which, action] : {std::pair{Key::up, ActionKey::up},
                                        {Key::left, ActionKey::left},
                                        {Key::pageDown, ActionKey::pageDown},
                                        {Key::shift, ActionKey::shift}}) {
        for (const bool down : {true, false}) {
            const auto heard = keys.take(special(which, down));
            ASSERT_EQ(heard.size(), 1u);
            EXPECT_EQ(heard[0].action, action);
            EXPECT_EQ(heard[0].down, down);
        }
    }
    EXPECT_EQ(keys.take(special(Key::enter, true)).at(0).character, U'\n');
    WindowEvent f5 = special(Key::none, true);
    f5.functionKey = 5;
    EXPECT_EQ(static_cast<int>(keys.take(f5).at(0).action), 5);
    EXPECT_TRUE(keys.take(special(Key::none, true)).empty()) << "a key that is nothing to a scene";
}

}  // namespace
}  // namespace rtsg
