// Names that an encoding cannot spell come back, whatever they are.
#include <random>

#include <gtest/gtest.h>

#include "commands/spelled_name.h"

namespace rtsg::detail {
namespace {

TEST(SpelledName, WhatCanStandStays) {
    for (const char* name : {"Box", "a_b", "_x", "_x12", "x002E", "_x00G0_", "a_x002e_b"})
        for (const Spelling spelling : {Spelling::classic, Spelling::element, Spelling::attribute}) {
            EXPECT_EQ(spellName(name, spelling), name);
            EXPECT_EQ(readName(name, spelling), name);
        }
    EXPECT_EQ(spellName("R\xC3\xA4um", Spelling::classic), "R\xC3\xA4um");
}

TEST(SpelledName, WhatCannotIsEscaped) {
    EXPECT_EQ(spellName("a.b", Spelling::classic), "a_x002E_b");
    EXPECT_EQ(spellName("a.b", Spelling::element), "a.b");
    EXPECT_EQ(spellName("1a1", Spelling::classic), "_x0031_a1");
    EXPECT_EQ(spellName("ROUTE", Spelling::classic), "_x0052_OUTE");
    EXPECT_EQ(spellName("ROUTE", Spelling::attribute), "ROUTE");
    EXPECT_EQ(spellName("DEF", Spelling::attribute), "_x0044_EF");
    EXPECT_EQ(spellName("\xF0\x9F\x98\x80", Spelling::element), "_x01F600_");
    EXPECT_EQ(spellName("", Spelling::classic), "_x_");
    EXPECT_EQ(spellName("_x_", Spelling::classic), "_x005F_x_");
    // Names that look like an escape and are none.
    EXPECT_EQ(spellName("_x002E_", Spelling::classic), "_x005F_x002E_");
    EXPECT_EQ(spellName("_x002E.", Spelling::classic), "_x005F_x002E_x002E_");
    EXPECT_EQ(readName("a_x0041_", Spelling::classic), "a_x0041_") << "an author's own: A needs no escape";
}

TEST(SpelledName, EveryNameComesBack) {
    const std::string_view pieces[] = {"_", "x",     "_x", "00",      "2E",    "005F",     "002E",
                                       ".", " ",     "a",  "DEF",     "ROUTE", "\xC3\xA4", "\xF0\x9F\x98\x80",
                                       "0", "1F600", "-",  "_x002E_", "#",     "\""};
    std::mt19937 random(7);
    for (int i = 0; i < 20'000; ++i) {
        std::string name;
        for (auto n = random() % 6; n > 0; --n) name += pieces[random() % std::size(pieces)];
        for (const Spelling spelling : {Spelling::classic, Spelling::element, Spelling::attribute}) {
            const std::string spelled = spellName(name, spelling);
            ASSERT_EQ(readName(spelled, spelling), name) << spelled;
            ASSERT_EQ(spelled.find_first_of(spelling == Spelling::classic ? " .\"#" : " \"#\xC3"), spelled.npos);
        }
    }
}

}  // namespace
}  // namespace rtsg::detail
