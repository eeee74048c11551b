#ifndef GUARD
#define GUARD

#ifdef __cplusplus
extern "C" {
#endif

#define UPPER_JOINTS JOINT_COUNT

/* Joints in the order of every array: JOINT_NAMES. */

/* Delay of each commanded torque [s]: evaluate the motion at time + delay. */
extern const double NAME_torque_delay[UPPER_JOINTS];

/* State of the presliding friction. */
typedef struct {
    int started;
    double theta[UPPER_JOINTS]; /* last motor position [rad] */
    double share[UPPER_JOINTS]; /* of the sliding friction, -1 ... 1 */
} NAME_memory;

typedef struct {
    double tau[UPPER_JOINTS];            /* motor torque [Nm] */
    double theta[UPPER_JOINTS];          /* motor position [rad] */
    double theta_velocity[UPPER_JOINTS]; /* motor velocity [rad/s] */
    double tau_joint[UPPER_JOINTS];      /* torque in the elastic joints [Nm] */
} NAME_feed_forward;

/* Call this before the first use of a memory. */
void NAME_reset(NAME_memory *memory);

/* Commands for a desired motion of the links.
 * q ... d4q: link positions [rad] and their four derivatives;
 * time: since the run began with cold gears [s], HUGE_VAL for warm gears;
 * memory: state of the presliding friction, the same one at every cycle; NULL: its sliding friction acts at
 * once. */
void NAME_inverse_dynamics(const double q[UPPER_JOINTS], const double dq[UPPER_JOINTS],
                           const double ddq[UPPER_JOINTS], const double d3q[UPPER_JOINTS],
                           const double d4q[UPPER_JOINTS], double time, NAME_memory *memory,
                           NAME_feed_forward *out);

/* Motor torque [Nm] as if the joints were rigid, for motions known up to ddq. */
void NAME_rigid_inverse_dynamics(const double q[UPPER_JOINTS], const double dq[UPPER_JOINTS],
                                 const double ddq[UPPER_JOINTS], double time, NAME_memory *memory,
                                 double tau[UPPER_JOINTS]);

/* Torque on the links, friction on the link side included [Nm]. */
void NAME_link_torque(const double q[UPPER_JOINTS], const double dq[UPPER_JOINTS],
                      const double ddq[UPPER_JOINTS], double tau_joint[UPPER_JOINTS]);

#ifdef __cplusplus
}
#endif

#endif
