// A process with sound, touch and bodies on one world, and without the light tracer: a ray and a hand meet a ball.
#include <cmath>
#include <cstdio>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/haptics/haptic_renderer.h>
#include <rtsg/physics/rigid_body_physics.h>
#include <rtsg/renderers/shared_world.h>

namespace {

bool check(bool good, const char* what) {
    if (!good) std::printf("failed: %s\n", what);
    return good;
}

}  // namespace

int main() {
    using namespace rtsg;
    Scene scene;
    const RigidBodyPhysics bodies(scene);
    const NodeId shape = scene.createNode(x3d::Shape::type), ball = scene.createNode(x3d::Sphere::type);
    bool good = check(scene.set(shape, x3d::Shape::geometry, ball).has_value(), "the shape is a ball");
    good &= check(scene.insertChild(scene.root(), x3d::RtsgScene::children, shape).has_value(), "it is in the scene");
    SharedWorld world(scene);
    SoundRenderer sound(world);
    HapticRenderer touch(world);
    good &= check(touch.attachToScene(scene).has_value(), "touch follows it");
    scene.newFrame(0);
    Ray ray;
    ray.origin = {0, 0, 10};
    ray.direction = {0, 0, -1};
    const Hit hit = world.rays().intersect(ray);
    good &= check(hit && std::abs(hit.t - 9) < .01, "a ray meets it after 9 m");
    good &= check(world.counts().flatteners == 1 && world.counts().rayWorlds == 1, "there is one world for all");
    good &= check(sound.attached(), sound.failure().empty() ? "sound follows it" : sound.failure().c_str());
    good &= check(touch.attached(), "touch goes on");
    return good ? 0 : 1;
}
