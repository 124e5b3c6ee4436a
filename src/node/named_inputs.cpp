#include "node/named_inputs.h"

#include <ros/names.h>

#include "input/short_text.h"

namespace dccd {

namespace {

bool isRemapped(const ros::NodeHandle& node, const std::string& name) {
  const std::string plain = node.resolveName(name, false);
  // Also to itself: that is a name that somebody typed.
  return node.resolveName(name) != plain || ros::names::getRemappings().count(plain) > 0;
}

void takeOctomapRemapping(const ros::NodeHandle& node, MonitorConfig& config) {
  if (config.octomap_topic_named) return;
  for (const char* name : {DEFAULT_OCTOMAP_TOPIC, "octomap"}) {
    if (!isRemapped(node, name)) continue;
    config.octomap_topic = name;
    config.octomap_topic_named = true;
    return;
  }
}

std::string howNamed(bool named) { return named ? " (named)" : " (default)"; }

}  // namespace

void takeRemappings(const ros::NodeHandle& node, MonitorConfig& config) {
  for (BodyConfig& body : config.bodies) {
    if (!body.isRigid() && isRemapped(node, body.topic)) body.topic_named = true;
  }
  config.cloud_named = config.cloud_named || isRemapped(node, DEFAULT_CLOUD_TOPIC);
  // What is beside such a topic is looked for beside what it is called in the end.
  for (CloudSource& source : config.clouds) source.topic = node.resolveName(source.topic);
  takeOctomapRemapping(node, config);
  config.checkMapNames();
}

std::string mapSourceOf(const ros::NodeHandle& node, const MonitorConfig& config) {
  if (config.takesMapFileAlone()) return config.octomap_file;
  std::vector<std::string> topics = config.liveMapNames();
  for (std::string& topic : topics) topic = node.resolveName(topic);
  return listOf(topics);
}

std::string inputsOf(const ros::NodeHandle& node, const MonitorConfig& config) {
  std::string text;
  for (const BodyConfig& body : config.bodies) {
    if (!body.body.link.empty()) continue;
    text += body.body.name + ": ";
    text += body.isRigid() ? "tf frame " + body.tf_frame : node.resolveName(body.topic) + howNamed(body.topic_named);
    text += ", ";
  }
  if (config.robot.named) text += "robot: " + std::to_string(config.robot.parts.size()) + " bodies by tf, ";
  const bool off = settingOf(config.effects, Effect::OCTOMAP) == EffectSetting::OFF;
  text += (config.takesClouds() ? "obstacle_cloud: " : "octomap: ") +
          (off ? "off" : mapSourceOf(node, config) + howNamed(config.namesOctomap()));
  return text + ", tf";
}

}  // namespace dccd
