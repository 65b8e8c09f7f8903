// Prints what changes in a running scene: the smallest subscriber. One line for each field that a frame has changed.
//
//     01_print_changes examples/room.x3dv
#include <iostream>

#include <rtsg/core/field_text.h>
#include <rtsg/documents/loader.h>

struct Printer : rtsg::Subscriber {
    rtsg::Result<> apply(const rtsg::Scene& scene, const rtsg::ChangeSet& changes) override {
        if (changes.isSnapshot()) {  // the first call: everything there is
            std::cout << "snapshot of " << scene.nodeCount() << " nodes\n";
            return {};
        }
        for (const rtsg::Change& change : changes.changes) {
            if (change.kind != rtsg::ChangeKind::setField || scene.name(change.node).empty()) continue;
            std::cout << "t = " << changes.time << "  " << scene.name(change.node) << '.'
                      << scene.node(change.node).type().fields[change.field].name << " = "
                      << rtsg::printFieldText(change.value) << '\n';
        }
        return {};
    }
};

int main(int argc, char** argv) {
    rtsg::Scene scene;
    rtsg::Diagnostics diagnostics;
    const bool loaded = argc == 2 && rtsg::loadFile(scene, argv[1], diagnostics);
    for (const rtsg::Diagnostic& d : diagnostics.all()) std::cerr << d.format() << '\n';
    if (!loaded) return 1;

    Printer printer;
    const rtsg::Attachment attachment = scene.bus().attach(printer);
    for (int frame = 0; frame <= 20; ++frame) scene.newFrame(frame / 10.0);
    return 0;
}
