#include <charconv>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {
namespace {

constexpr int kMostQuota = 1'000'000;  // as QuotaRequest
constexpr char kNoQuota[] = "none";

struct QuotaOptions {
  std::string owner{};
  std::string slots{};  ///< a number or kNoQuota; empty: it is asked for
};

void Declare(OptionList& list, QuotaOptions& options) {
  list.Text("OWNER", options.owner, "of campaigns, as `calibctl show` tells [all]");
  list.Text("--slots", options.slots,
            "N: slots that the owner's runs hold at most, 0 none at all; `none`: no bound");
}

/// Empty: no bound.
absl::StatusOr<std::optional<int>> SlotsIn(const std::string& text) {
  if (text == kNoQuota) return std::optional<int>();
  int slots = 0;
  const char* const end = text.data() + text.size();
  const auto [at, error] = std::from_chars(text.data(), end, slots);
  if (error != std::errc() || at != end || slots < 0 || slots > kMostQuota) {
    return absl::InvalidArgumentError(absl::StrCat("--slots: ", text,
                                                   " is no whole number from 0 to ", kMostQuota,
                                                   " and not `", kNoQuota, "`"));
  }
  return std::optional<int>(slots);
}

nlohmann::ordered_json JsonOf(const v1::OwnerShare& share) {
  nlohmann::ordered_json json{{"owner", share.owner()}, {"slots", nullptr}};
  if (share.has_slots()) json["slots"] = share.slots();
  json["held"] = share.held();
  json["campaigns"] = share.campaigns();
  return json;
}

std::string InWords(const v1::OwnerShare& share) {
  return absl::StrCat("Runs of ", share.owner(), " hold ", share.held(), " slots",
                      share.has_slots() ? absl::StrCat(", at most ", share.slots()) : "",
                      share.campaigns() == 0 ? "; there is no campaign of theirs now" : "", ".\n");
}

absl::StatusOr<int> Tell(const CommonOptions& common, const std::string& owner,
                         client::Client& client) {
  ASSIGN_OR_RETURN(std::vector<v1::OwnerShare> shares, client.ListShares());
  if (!owner.empty()) {
    std::erase_if(shares, [&](const v1::OwnerShare& share) { return share.owner() != owner; });
    if (shares.empty()) {
      return absl::NotFoundError(
          absl::StrCat(owner, " has no campaign that is not over, holds no slot and has no quota"));
    }
  }
  if (common.json) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const v1::OwnerShare& share : shares) list.push_back(JsonOf(share));
    std::cout << list.dump(2) << "\n";
    return kDone;
  }
  report::TextTable table({"<owner", "slots held", "quota", "campaigns"});
  for (const v1::OwnerShare& share : shares) {
    table.AddRow({share.owner(), std::to_string(share.held()),
                  share.has_slots() ? std::to_string(share.slots()) : kNoQuota,
                  std::to_string(share.campaigns())});
  }
  std::cout << (shares.empty() ? "Nobody has a campaign that is not over, or a quota.\n"
                               : table.ToString());
  return kDone;
}

absl::StatusOr<int> Quota(const CommonOptions& common, const QuotaOptions& options) {
  std::optional<int> slots;
  if (!options.slots.empty()) {
    if (options.owner.empty()) {
      return absl::InvalidArgumentError("--slots: of whom? `calibctl quota OWNER --slots N`");
    }
    ASSIGN_OR_RETURN(slots, SlotsIn(options.slots));
  }
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  if (options.slots.empty()) return Tell(common, options.owner, session->client());
  ASSIGN_OR_RETURN(const auto share, session->client().SetQuota(options.owner, slots));
  std::cout << (common.json ? JsonOf(share).dump(2) + "\n" : InWords(share));
  return kDone;
}

}  // namespace

Verb QuotaVerb() {
  return MakeVerb<QuotaOptions>({.name = "quota",
                                 .description = "How many slots an owner's runs hold, and may hold",
                                 .example = "quota anna --slots 16"},
                                &Declare, &Quota);
}

}  // namespace calib::ctl
