// Finds out how large pictures of projectors and lines of Texts are, and writes it down.
#include "size_reports.h"

#include <cmath>

#include <rtsg/core/x3d.h>

#include "fetch_ahead.h"
#include "picture_size.h"

namespace rtsg {

namespace {

using Projector = x3d::TextureProjector;
using Parallel = x3d::TextureProjectorParallel;

bool isProjector(const Node& node) {
    return node.is(Projector::type) || node.is(Parallel::type);
}

bool isScript(const Node& node) {
    return node.type().kind == NodeType::Kind::script || node.type().name == "Script";
}

float ratioOf(double width, double height) {
    return width > 0 && height > 0 ? static_cast<float>(width / height) : 0.0f;
}

/// The aspect ratio of the first url's picture whose header states it.
float ratioOfFile(const Scene& scene, const Node& texture, const Resources& resources) {
    using I = x3d::ImageTexture;
    if (!texture.get(I::load)) return 0;
    for (const String& url : texture.get(I::url)) {
        const auto resource = resources.open(scene, texture, I::url.index, url.view());
        if (!resource) continue;
        const Resource& file = *resource;
        const auto size = pictureSize(
            {file.size(), [&](std::uint64_t offset, std::size_t length) { return file.readAt(offset, length); }});
        if (size) return ratioOf(size->width, size->height);
    }
    return 0;
}

/// 0: nobody knows.
float ratioOfPicture(const Scene& scene, NodeId picture, const Resources& resources) {
    const Node* texture = scene.effectiveNode(picture);
    if (!texture) return 0;
    if (texture->is(x3d::PixelTexture::type)) {
        const Image& image = texture->get(x3d::PixelTexture::image);
        return ratioOf(image.width(), image.height());
    }
    return texture->is(x3d::ImageTexture::type) ? ratioOfFile(scene, *texture, resources) : 0.0f;
}

/// Whether a field of this type may say how large a picture or a Text is.
bool mayResize(FieldType type) {
    switch (type) {
        case FieldType::SFBool:
        case FieldType::SFFloat:
        case FieldType::MFFloat:
        case FieldType::SFString:
        case FieldType::MFString:
        case FieldType::MFInt32:
        case FieldType::SFImage:
        case FieldType::SFNode:
        case FieldType::MFNode:
            return true;
        default:
            return false;
    }
}

bool awaitsPicture(const Scene& scene, const Node& projector, const Resources& resources) {
    const NodeId picture =
        projector.is(Projector::type) ? projector.get(Projector::texture) : projector.get(Parallel::texture);
    const Node* texture = scene.effectiveNode(picture);
    using I = x3d::ImageTexture;
    return texture && texture->is(I::type) && texture->get(I::load) &&
           awaitsUrls(scene, *texture, I::url.index, resources);
}

template <class N>
bool reportRatio(Scene& scene, const Node& node, const Resources& resources) {
    const float ratio = ratioOfPicture(scene, node.get(N::texture), resources);
    return ratio != node.get(N::_aspectRatio) && scene.set(node.id(), N::_aspectRatio, ratio).has_value();
}

}  // namespace

SizeReports::SizeReports(const Scene& scene) {
    scene.forEachNode([&](const Node& node) {
        if (isProjector(node)) projectors_.insert(node.id().value);
    });
}

void SizeReports::askTexts(const Scene& scene, bool heardAlone) {
    heardAlone_ = heardAlone;
    anyScript_ = false;
    scene.forEachNode([&](const Node& node) {
        if (node.is(x3d::Text::type)) texts_.insert(node.id().value);
        anyScript_ |= isScript(node);
    });
}

bool SizeReports::mayBeHeard(const Scene& scene, NodeId text) const {
    using T = x3d::Text;
    return !heardAlone_ || anyScript_ || scene.isHeard(text, T::lineBounds.index) ||
           scene.isHeard(text, T::origin.index) || scene.isHeard(text, T::textBounds.index);
}

/// Those of which somebody may hear by now.
void SizeReports::wakeHeard(const Scene& scene) {
    if (!anyScript_ && std::exchange(hearingEdits_, scene.hearingEdits()) == scene.hearingEdits()) return;
    std::erase_if(silent_, [&](std::uint32_t number) {
        const bool wakes = mayBeHeard(scene, NodeId{number});
        if (wakes) texts_.insert(number);
        return wakes || !scene.find(NodeId{number});
    });
}

/// Whoever uses a picture or a font style, directly or as the body of PROTO instances.
void SizeReports::noteAbove(const Scene& scene, NodeId part) {
    std::vector<NodeId> climbing{part};
    for (std::size_t i = 0; i < climbing.size(); ++i)
        for (const ParentRef& parent : scene.parents(climbing[i])) {
            const Node& above = scene.node(parent.node);
            if (isProjector(above))
                projectors_.insert(parent.node.value);
            else if (above.is(x3d::Text::type))
                texts_.insert(parent.node.value);
            else if (above.is(x3d::FontStyle::type) || above.is(x3d::ScreenFontStyle::type) ||
                     (parent.field == above.type().body() && above.type().kind != NodeType::Kind::builtin))
                climbing.push_back(parent.node);  // bodies are part of the hierarchy: no cycles
        }
}

void SizeReports::note(const Scene& scene, const ChangeSet& set) {
    for (const Change& change : set.changes) {
        const bool isNew = change.kind == ChangeKind::createNode;
        // Most changes move something: they cost no look at their node.
        if (!isNew && (change.kind != ChangeKind::setField || !mayResize(change.value.type()))) continue;
        const Node* node = scene.find(change.node);
        if (!node) continue;
        anyScript_ |= isNew && isScript(*node);
        using T = x3d::Text;
        if (node->is(T::type)) {
            const auto isOne = [&](auto... fields) { return ((change.field == fields.index) || ...); };
            if (isNew || isOne(T::string, T::length, T::maxExtent, T::fontStyle)) texts_.insert(change.node.value);
        } else if (isProjector(*node)) {
            static_assert(Projector::texture.index == Parallel::texture.index);
            if (isNew || change.field == Projector::texture.index) projectors_.insert(change.node.value);
        } else if (node->is(x3d::FontStyle::type) || node->is(x3d::ScreenFontStyle::type) ||
                   node->is(x3d::ImageTexture::type) || node->is(x3d::FontLibrary::type) ||
                   node->is(x3d::PixelTexture::type) || (!isNew && change.field == node->type().body())) {
            noteAbove(scene, change.node);
        }
    }
}

std::size_t SizeReports::answer(Scene& scene, const Resources& resources, const TextMeasure& measure) {
    std::size_t count = 0;
    for (const std::uint32_t number : std::exchange(projectors_, {})) {
        const Node* node = scene.find(NodeId{number});
        if (!node) continue;
        if (awaitsPicture(scene, *node, resources)) {
            projectors_.insert(number);
            continue;
        }
        const bool reported = node->is(Projector::type) ? reportRatio<Projector>(scene, *node, resources)
                                                        : reportRatio<Parallel>(scene, *node, resources);
        if (reported) ++count;
    }
    if (!silent_.empty()) wakeHeard(scene);
    for (const std::uint32_t number : std::exchange(texts_, {})) {
        const Node* node = scene.find(NodeId{number});
        if (!node || !node->is(x3d::Text::type) || !measure) continue;
        if (!mayBeHeard(scene, node->id())) {
            silent_.insert(number);
            continue;
        }
        const Array<float> found = measure(scene, *node);
        if (found != node->get(x3d::Text::_measured) && scene.set(node->id(), x3d::Text::_measured, found)) ++count;
    }
    return count;
}

}  // namespace rtsg
