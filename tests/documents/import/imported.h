// The import of a file of another program: its commands and its diagnostics.
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>

#include <gtest/gtest.h>

#include <rtsg/documents/loader.h>

#include "core/scene_check.h"
#include "documents/recording_handler.h"

namespace rtsg::test {

class Imported {
  public:
    explicit Imported(std::string_view bytes, const char* version = "4.0") : problems_("test") {
        good = readDocument(bytes, handler_, problems_);
        commands = handler_.text();
        problems = test::allText(problems_);
        if (!commands.empty()) {
            EXPECT_EQ(handler_.header.version, version) << "what other programs write needs no more";
        }
        EXPECT_EQ(handler_.violation, "");
    }
    bool good = false;
    std::string commands, problems;

  private:
    RecordingHandler handler_;
    Diagnostics problems_;
};

template <class T>
void put(std::string& out, T value) {
    out.append(reinterpret_cast<const char*>(&value), sizeof(value));
}

inline std::string binaryStl(std::initializer_list<std::array<float, 9>> facets, const char* title = "title") {
    std::string bytes(title);
    bytes.resize(80, ' ');
    put(bytes, static_cast<std::uint32_t>(facets.size()));
    for (const auto& facet : facets) {
        for (int i = 0; i < 3; ++i) put(bytes, 0.0f);
        for (const float number : facet) put(bytes, number);
        put(bytes, std::uint16_t{0});
    }
    return bytes;
}

}  // namespace rtsg::test
