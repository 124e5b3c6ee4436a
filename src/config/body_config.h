// The parts of the configuration that have files of their own: the map; bodies, where they come from, what they keep
// apart from.
#pragma once

#include <algorithm>
#include <array>

#include "config/monitor_config.h"

namespace dccd {

/// Limits of numbers that have none of their own.
constexpr double LARGE = 1e9;
constexpr int MANY = 1000000000;

/// ParameterReader::choice() of an enumeration, whose values count the choices.
template <class Enum>
Enum choiceOf(ParameterReader& reader, const std::string& name, Enum fallback,
              const std::vector<std::string>& choices) {
  const std::string word = reader.choice(name, choices[static_cast<std::size_t>(fallback)], choices);
  return static_cast<Enum>(std::find(choices.begin(), choices.end(), word) - choices.begin());
}

/// Refuses what once was a parameter of this section ("markers/"; "": of the root; "bodies/": of a body), and says what
/// to write instead.
void refuseGone(ParameterReader& reader, const std::string& section);
/// The map's parameters.
void readMap(ParameterReader& reader, MonitorConfig& config);
/// Refuses own voxels beside an unknown space that is occupied. After the effects.
void checkOwnVoxels(const ParameterReader& reader, const MonitorConfig& config);
/// own_voxels_m of the section [m], or the fallback; `auto`: ONE_VOXEL.
double ownVoxelsOf(ParameterReader& reader, double fallback);
/// minimum_separation_m of the section [m], or the fallback.
double separationOf(ParameterReader& reader, double fallback);
/// max_speed_m_s, max_acceleration_m_s2 and speed_scale, for all bodies. Before the bodies.
void readSpeeds(ParameterReader& reader, MonitorConfig& config);
/// max_speed_m_s of the section, or the fallback.
SpeedBound speedBoundOf(ParameterReader& section, const SpeedBound& fallback);
/// Which body each frame of a carried_by carries. After the robot.
void findCarriers(const ParameterReader& reader, MonitorConfig& config);
/// Refuses a speed_scale that would be 0 for lack of any bound. After the robot.
void checkSpeeds(const ParameterReader& reader, const MonitorConfig& config);
/// Two bodies that an entry names under `between`, or a body and OBSTACLE_BODY, or a body twice.
using Partners = std::array<std::uint16_t, 2>;
/// Of the robot's links and groups, as parameters have them.
std::vector<std::string> namesOf(const Robot& robot);
/// All that it names: a robot's link or group stands for its bodies, "octomap" is the map, "self" the other one again.
std::vector<Partners> readPartners(ParameterReader& entry, const MonitorConfig& config);
/// The bodies, and which of them is the clock. After the separation that is for all of them.
void readBodies(ParameterReader& reader, MonitorConfig& config);
/// minimum_separation_pairs. After the bodies.
void readSeparationPairs(ParameterReader& reader, MonitorConfig& config);
/// expected_contacts and phase. After the bodies.
void readExpectedContacts(ParameterReader& reader, MonitorConfig& config);

}  // namespace dccd
