// Why nothing arrives, as far as the master and the clock can tell.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace dccd {

/// One topic that is waited for.
struct AwaitedTopic {
  std::string name;              ///< resolved
  std::uint32_t publishers = 0;  ///< connected
  std::string named_by;          ///< the argument or parameter that gives it; empty: a map's
  bool heard = false;            ///< messages have come before
};

/// A sentence about the clock or about topics from which nothing comes, with what to do; empty when all is well.
/// `published`: what there is, datatypes by topic; empty where the master does not answer.
std::string silenceHint(const std::vector<AwaitedTopic>& silent, const std::map<std::string, std::string>& published);

/// The sentence is of publishers alone that nobody has heard yet, where nothing else could be meant.
bool isYetToCome(const std::string& silence);

/// A sentence about octomaps that are published on other topics than `listened`, on which none has come; empty: there
/// are none.
std::string unheardMapsHint(const std::string& listened, const std::map<std::string, std::string>& published);

}  // namespace dccd
