#include "server/page/answers.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "proto/rpc/digest.h"
#include "server/client/documents.h"
#include "server/client/findings.h"
#include "server/client/kept_grains.h"
#include "server/page/compact.h"

namespace calib::page {
namespace {

/// Shorter ones fit into a packet of the network as they are.
constexpr std::size_t kWorthCompressing = 1400;
constexpr std::size_t kTagDigits = 32;

absl::StatusOr<std::string> Find(client::Client& client, client::CampaignShelf& shelf,
                                 const Question& question) {
  const std::string& campaign = question.campaign;
  switch (question.document) {
    case Document::kList:
      return client::ListDocument(client, {.limit = question.limit, .after = question.after});
    case Document::kShow:
      return client::ShowDocument(client, campaign);
    case Document::kLineage:
      return client::LineageDocument(client, campaign);
    case Document::kPosterior:
      return client::PosteriorDocument(client, campaign, question.number, &shelf);
    case Document::kCompare:
      return client::CompareDocument(client, campaign, &shelf);
    case Document::kDiagnosis:
      return client::FindingDocument(client, campaign, client::kDiagnosis);
    case Document::kImprovement:
      return client::FindingDocument(client, campaign, client::kImprovement);
    case Document::kSamples:
      return client::SamplesDocument(client, campaign, &shelf);
    case Document::kStates:
      return client::StatesDocument(client, campaign, *question.number);
    case Document::kGrains:
      return client::GrainsDocument(
          client,
          {.campaign = campaign, .sample = *question.number, .experiment = question.experiment},
          question.load_step);
    case Document::kWorkers:
      return client::WorkersDocument(client);
    case Document::kMetrics: {
      ASSIGN_OR_RETURN(const v1::Metrics metrics, client.GetMetrics());
      return metrics.text();
    }
    case Document::kReady: {
      ASSIGN_OR_RETURN(const v1::Metrics metrics, client.GetMetrics());
      if (!metrics.not_ready().empty()) return absl::ResourceExhaustedError(metrics.not_ready());
      return std::string("ok\n");
    }
  }
  return absl::InternalError("no such document");
}

bool IsText(Document document) {
  return document == Document::kMetrics || document == Document::kReady;
}

}  // namespace

Kept MakeKept(std::string content) {
  Kept kept{.etag = absl::StrCat("\"", rpc::Sha256Hex(content).substr(0, kTagDigits), "\"")};
  if (content.size() > kWorthCompressing) {
    if (std::string gzip = Gzip(content); !gzip.empty()) {
      kept.gzip = std::make_shared<const std::string>(std::move(gzip));
    }
  }
  kept.plain = std::make_shared<const std::string>(std::move(content));
  return kept;
}

void Answers::Get(const Question& question, const std::string& stamp, Then then) {
  const std::string key = question.Key();
  if (const auto kept = kept_.find(key);
      kept != kept_.end() && !stamp.empty() && kept->second.stamp == stamp) {
    used_.splice(used_.begin(), used_, kept->second.used);
    then(kept->second.kept);
    return;
  }
  const auto [waiting, is_first] = waiting_.try_emplace({key, stamp});
  waiting->second.push_back(std::move(then));
  if (!is_first) return;
  Askers& askers = question.document == Document::kCompare ? slow_ : quick_;
  const bool asked = askers.Ask([this, question, key,
                                 stamp](const absl::StatusOr<client::Client*>& client) {
    const absl::StatusOr<std::string> found = client.ok()
                                                  ? Find(**client, shelf_, question)
                                                  : absl::StatusOr<std::string>(client.status());
    const absl::StatusOr<Kept> kept =
        found.ok()
            ? absl::StatusOr<Kept>(MakeKept(IsText(question.document) ? *found : Compact(*found)))
            : absl::StatusOr<Kept>(found.status());
    post_([this, key, stamp, kept] { Found(key, stamp, kept); });
    return found.status();
  });
  if (!asked) {
    Found(key, stamp,
          absl::ResourceExhaustedError("more is asked at a time than this page answers"));
  }
}

void Answers::Found(const std::string& key, const std::string& stamp,
                    const absl::StatusOr<Kept>& found) {
  if (found.ok() && !stamp.empty()) Keep(key, stamp, *found);
  auto waiting = waiting_.extract({key, stamp});
  if (waiting.empty()) return;
  for (const Then& then : waiting.mapped()) then(found);
}

std::size_t Answers::BytesOf(const Kept& kept) {
  return kept.plain->size() + (kept.gzip == nullptr ? 0 : kept.gzip->size());
}

void Answers::Keep(const std::string& key, const std::string& stamp, const Kept& kept) {
  const auto [entry, is_new] = kept_.try_emplace(key);
  if (is_new) {
    entry->second.used = used_.insert(used_.begin(), key);
  } else {
    bytes_ -= BytesOf(entry->second.kept);
    used_.splice(used_.begin(), used_, entry->second.used);
  }
  entry->second.stamp = stamp;
  entry->second.kept = kept;
  bytes_ += BytesOf(kept);
  while (bytes_ > kMostBytes && used_.size() > 1) {
    const auto oldest = kept_.find(used_.back());
    bytes_ -= BytesOf(oldest->second.kept);
    kept_.erase(oldest);
    used_.pop_back();
  }
}

}  // namespace calib::page
