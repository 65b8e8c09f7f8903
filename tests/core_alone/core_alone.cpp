// A scene whose process has neither readers of documents nor a script engine: it edits, runs, and says what it lacks.
#include <cstdio>
#include <string_view>

#include <rtsg/core/bus.h>
#include <rtsg/core/document_services.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

namespace {

bool check(bool good, const char* what) {
    if (!good) std::printf("failed: %s\n", what);
    return good;
}

}  // namespace

int main() {
    using namespace rtsg;
    Scene scene;
    const NodeId clock = scene.createNode(x3d::TimeSensor::type), script = scene.createNode(x3d::Script::type);
    bool good = check(scene.set(clock, x3d::TimeSensor::loop, true).has_value(), "a field is set");
    good &= check(scene.set(script, x3d::Script::url, Array<String>{String("ecmascript:")}).has_value(), "another is");
    for (const NodeId node : {clock, script})
        good &= check(scene.insertChild(scene.root(), x3d::RtsgScene::children, node).has_value(), "a node is put in");
    scene.newFrame(1);
    good &= check(scene.newFrame(1.25)->changes.size() > 0, "the clock runs");
    const auto& said = scene.diagnostics().all();
    good &= check(said.size() == 1 && said[0].text.find("no script language") != std::string::npos,
                  "the Script says that it does not run, once");
    const auto piece = scene.documents().makePiece(scene, "Group { }", {}, nullptr);
    good &= check(!piece && piece.error().text.find("registerDocuments") != std::string::npos, "nobody reads text");
    return good ? 0 : 1;
}
