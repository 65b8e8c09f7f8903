// A served scene beside the program that follows it, and what a mirror must say at its end.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "program.h"

namespace rtsg::test {

class Mirror : public CommandLine {
  protected:
    /// `scene`: its file; empty: the usual one.
    void serve(std::vector<std::string> more, const std::string& bind, const std::string& scene = {}) {
        std::vector<std::string> arguments{"serve", scene.empty() ? file : scene, "--bind", bind, "--fps", "30",
                                           "--json"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        server = std::make_unique<Program>(arguments, streams());
        const std::string line = server->firstLine();
        ASSERT_NE(line, "");
        endpoint = nlohmann::json::parse(line).at("endpoint");
    }

    std::unique_ptr<Program> server;
    std::string endpoint;
};

inline void expectEqual(const nlohmann::json& mirror) {
    EXPECT_EQ(mirror.at("equal"), true) << mirror;
    EXPECT_EQ(mirror.at("hash"), mirror.at("origin_hash")) << mirror;
    EXPECT_EQ(mirror.at("divergences"), 0) << mirror;
    EXPECT_GT(mirror.at("frames"), 1) << mirror;
    EXPECT_GT(mirror.at("bytes"), 0) << mirror;
}

}  // namespace rtsg::test
