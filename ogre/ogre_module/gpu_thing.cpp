// Places things, and sets the parameters of their programs.
#include "gpu_thing.h"

#include <cmath>

#include <OgreCamera.h>
#include <OgreRenderQueue.h>
#include <OgreSceneNode.h>

namespace rtsg {

GpuThing::GpuThing(const ViewNumbers& view) : view_(view) {
    setCastShadows(false);
    setUseIdentityView(false);
}

void GpuThing::show(const GpuMesh& mesh) {
    setRenderOperation(mesh.operation());
    lower_ = mesh.lower(), upper_ = mesh.upper(), strokes_ = mesh.strokes();
    setVisible(!mesh.empty());
    findBounds();
}

void GpuThing::setThing(std::uint32_t number, const RasterThing& thing, int record) {
    thing_ = thing;
    named_ = {static_cast<float>(number) + 1, 0, 0, 0};
    stroke_ = {thing.stroke.x, thing.stroke.y, thing.stroke.z, thing.stroke.w};
    attenuation_ = {thing.attenuation.x, thing.attenuation.y, thing.attenuation.z, thing.attenuation.w};
    setVisibilityFlags(1u << std::min<unsigned>(thing.layer, 31));
    setRecord(record);
    setLinear(thing.linear, thing.mirrored);
}

void GpuThing::setRecord(int record) {
    const int kind = (thing_.colored ? 1 : 0) + (thing_.alphaColored ? 2 : 0) + (thing_.fogged ? 4 : 0);
    const int sides = (thing_.fronts ? 1 : 0) + (thing_.backs ? 2 : 0);
    numbers_ = {static_cast<float>(record), static_cast<float>(kind), static_cast<float>(sides), numbers_.w};
}

void GpuThing::setLinear(const glm::mat3& linear, bool mirrored) {
    thing_.linear = linear, thing_.mirrored = mirrored;
    numbers_.w = mirrored ? -1.0f : 1.0f;
    findBounds();
}

void GpuThing::setBackground() {
    setBoundingBox(Ogre::AxisAlignedBox::BOX_INFINITE);
    setRenderQueueGroup(Ogre::RENDER_QUEUE_BACKGROUND);
}

void GpuThing::findBounds() {
    const glm::vec3 middle = thing_.linear * (.5f * (lower_ + upper_)), half = .5f * (upper_ - lower_);
    const glm::mat3& m = thing_.linear;
    const glm::vec3 reach = glm::abs(m[0]) * half.x + glm::abs(m[1]) * half.y + glm::abs(m[2]) * half.z;
    radius_ = glm::length(glm::abs(middle) + reach);
    if (strokes_ || !std::isfinite(radius_))  // wider than their bounds
        setBoundingBox(Ogre::AxisAlignedBox::BOX_INFINITE);
    else
        setBoundingBox({middle.x - reach.x, middle.y - reach.y, middle.z - reach.z, middle.x + reach.x,
                        middle.y + reach.y, middle.z + reach.z});
    if (mParentNode) mParentNode->needUpdate();
}

void GpuThing::getWorldTransforms(Ogre::Matrix4* to) const {
    const glm::mat3& m = thing_.linear;
    const Ogre::Vector3 at = mParentNode ? mParentNode->_getDerivedPosition() : Ogre::Vector3::ZERO;
    *to = Ogre::Matrix4(m[0].x, m[1].x, m[2].x, at.x, m[0].y, m[1].y, m[2].y, at.y, m[0].z, m[1].z, m[2].z, at.z, 0, 0,
                        0, 1);
}

Ogre::Real GpuThing::getSquaredViewDepth(const Ogre::Camera* camera) const {
    const glm::vec3 middle = thing_.linear * (.5f * (lower_ + upper_));
    const Ogre::Vector3 at = mParentNode->_getDerivedPosition() + Ogre::Vector3(middle.x, middle.y, middle.z);
    const float squared = (at - camera->getDerivedPosition()).squaredLength();
    return thing_.first ? squared * 1.00001f : squared;
}

void GpuThing::_updateCustomGpuParameter(const Ogre::GpuProgramParameters::AutoConstantEntry& entry,
                                         Ogre::GpuProgramParameters* parameters) const {
    const auto which = static_cast<DrawNumber>(entry.data);
    const Ogre::Vector4& value = which == DrawNumber::thing         ? numbers_
                                 : which == DrawNumber::stroke      ? stroke_
                                 : which == DrawNumber::attenuation ? attenuation_
                                 : which == DrawNumber::named       ? named_
                                                                    : view_[entry.data];
    parameters->_writeRawConstant(entry.physicalIndex, value, entry.elementCount);
}

}  // namespace rtsg
