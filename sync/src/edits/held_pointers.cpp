// Remembers from the events of peers whose pointer is whose.
#include "held_pointers.h"

#include <rtsg/core/device_input.h>
#include <rtsg/core/x3d.h>

namespace rtsg::mirror {

using Root = x3d::RtsgScene;

void HeldPointers::saw(const Scene& scene, std::uint64_t client, const Change& change) {
    if (change.kind != ChangeKind::event || change.node != scene.root() || change.field != Root::pointer.index) return;
    const auto input = PointerInput::fromValue(change.value.as<Array<double>>());
    if (!input) return;  // the event had no effect
    if (input->kind == PointerInput::Kind::absent && input->buttons == 0)
        clients_.erase(input->device);
    else
        clients_[input->device] = client;
}

std::vector<Change> HeldPointers::leave(const Scene& scene, std::uint64_t client) {
    std::vector<Change> events;
    std::erase_if(clients_, [&](const auto& held) {
        if (held.second != client) return false;
        PointerInput absent;
        absent.kind = PointerInput::Kind::absent;
        absent.device = held.first;
        Change event;
        event.kind = ChangeKind::event;
        event.node = scene.root();
        event.field = Root::pointer.index;
        event.value = absent.toValue();
        events.push_back(std::move(event));
        return true;
    });
    return events;
}

}  // namespace rtsg::mirror
