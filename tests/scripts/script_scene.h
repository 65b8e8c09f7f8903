// A scene with one Script, for tests: its fields and program as text, what it prints and what was wrong with it.
#pragma once

#include <string>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/scripts/run_scripts.h>

namespace rtsg::test {

inline ScriptOptions limits(bool enabled, double seconds, std::size_t bytes = std::size_t{256} << 20) {
    ScriptOptions options;
    options.enabled = enabled;
    options.timeLimit = seconds;
    options.heapLimit = bytes;
    return options;
}

/// A scene with one Script `S`, made of declared fields, its program and more nodes.
struct ScriptScene {
    std::string printed;  // outlives the scene, whose scripts may print when it goes
    Scene scene;
    Diagnostics diagnostics{"test"};
    double time = 0;

    explicit ScriptScene(const std::string& fields, const std::string& program, const std::string& others = {},
                         ScriptOptions options = limits(true, 60)) {  // a sanitizer makes all slower
        options.print = [this](std::string_view text) { printed += text; };
        runScripts(scene, std::move(options));
        const std::string text = "#X3D V4.0 utf8\nPROFILE Full\n" + others + "\nDEF S Script { " + fields +
                                 " url \"ecmascript:" + program + "\" }\n";
        EXPECT_TRUE(loadText(scene, text, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
    }

    NodeId script() const { return scene.findName("S"); }
    FieldIndex field(std::string_view node, std::string_view name) const {
        return scene.node(scene.findName(node)).type().find(name);
    }
    template <class T>
    T get(std::string_view name, std::string_view node = "S") const {
        return scene.node(scene.findName(node)).value(field(node, name)).template as<T>();
    }
    void send(std::string_view name, Value value, std::string_view node = "S") {
        ASSERT_TRUE(scene.sendEvent(scene.findName(node), field(node, name), std::move(value)));
    }
    std::shared_ptr<const ChangeSet> frame() { return scene.newFrame(time += 1); }
    std::string problems() {
        std::string text;
        for (const Diagnostic& d : scene.diagnostics().all()) text += d.text + "\n";
        return text;
    }
};

/// The value of an expression in a program, as text.
inline std::string evaluated(const std::string& expression) {
    ScriptScene s("outputOnly SFString text", "function initialize() { text = String(" + expression + "); }");
    s.frame();
    EXPECT_EQ(s.problems(), "") << expression;
    return std::string(s.get<String>("text").view());
}

}  // namespace rtsg::test
