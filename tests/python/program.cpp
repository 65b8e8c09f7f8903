// Carries out a random program on a scene by the C++ API: a line an operation, and after each frame the state's hash.
//
// test_random_programs.py does the same from Python. Nodes are named by their numbers, values are ClassicVRML.
#include <iostream>
#include <sstream>
#include <string>

#include <rtsg/core/field_path.h>
#include <rtsg/documents/loader.h>
#include <rtsg/physics/rigid_body_physics.h>

namespace {

rtsg::FieldRef fieldOf(const rtsg::Scene& scene, std::uint32_t node, const std::string& name) {
    const auto found = rtsg::findField(scene, "#" + std::to_string(node) + "." + name);
    return found ? *found : rtsg::FieldRef{};
}

/// False: the scene refused it.
bool carryOut(rtsg::Scene& scene, std::istringstream& line) {
    std::string what, name, other;
    std::uint32_t node = 0, second = 0;
    line >> what;
    if (what == "create") return line >> name && scene.createNode(std::string_view(name));
    line >> node;
    const rtsg::NodeId id{node};
    if (what == "destroy") return scene.destroyNode(id).has_value();
    if (what == "name") return line >> name && scene.setName(id, name);
    if (what == "set" || what == "send") {
        line >> name;
        std::string value;
        std::getline(line, value);
        const std::string path = "#" + std::to_string(node) + "." + name;
        return (what == "set" ? rtsg::setFieldText(scene, path, value) : rtsg::sendFieldText(scene, path, value))
            .has_value();
    }
    line >> name >> second >> other;
    const rtsg::FieldRef at = fieldOf(scene, node, name);
    if (what == "child") return scene.insertChild(id, at.field, rtsg::NodeId{second}).has_value();
    const rtsg::FieldRef to = fieldOf(scene, second, other);
    if (what == "route") return scene.addRoute(at.node, at.field, to.node, to.field).has_value();
    return scene.removeRoute(at.node, at.field, to.node, to.field).has_value();
}

}  // namespace

int main() {
    rtsg::Scene scene;
    rtsg::registerDocuments(scene);
    scene.setNavigation(true);
    const rtsg::RigidBodyPhysics physics(scene);
    std::size_t refused = 0;
    for (std::string text; std::getline(std::cin, text);) {
        std::istringstream line(text);
        if (text.starts_with("frame ")) {
            scene.newFrame(std::stod(text.substr(6)));
            std::cout << scene.hash().hex() << ' ' << refused << '\n';
        } else if (!carryOut(scene, line)) {
            ++refused;
        }
    }
    return 0;
}
