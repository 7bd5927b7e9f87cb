#pragma once
// The scatter of an observable along the stages of its experiment.

#include "inference/data/data_set.h"
#include "inference/scatter/scatter.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// inference::FitScatter of one group of GroupsOf(data), with the stages and the path of its
/// experiment. moments: along its readings. data: see MakeDataSet.
inference::GroupScatter FitGroupScatter(const Campaign& campaign, const inference::DataSet& data,
                                        const inference::ReadingGroups::value_type& group,
                                        const inference::ScatterMoments& moments);

}  // namespace calib::campaign
