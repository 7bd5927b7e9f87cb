#include "server/ctl/state_table.h"

#include <gtest/gtest.h>

namespace calib::ctl {
namespace {

TEST(StateTable, UnitesTheColumnsOfDifferentTests) {
  EXPECT_EQ(JoinStateTables({{"a", "load_step,axial_strain,q_over_p\n0,0.1,1.25\n1,0.2,1.5\n"},
                             {"b", "load_step,axial_strain,slide_time\n0,0.3,7\n"}}),
            "experiment,load_step,axial_strain,q_over_p,slide_time\n"
            "a,0,0.1,1.25,\na,1,0.2,1.5,\nb,0,0.3,,7\n");
}

TEST(StateTable, LeavesOutARowThatIsStillBeingWritten) {
  EXPECT_EQ(JoinStateTables({{"a", "load_step,x\n0,1\n1,2.3"}}), "experiment,load_step,x\na,0,1\n");
}

}  // namespace
}  // namespace calib::ctl
