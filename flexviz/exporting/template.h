#ifndef GUARD
#define GUARD

#ifdef __cplusplus
extern "C" {
#endif

#define UPPER_JOINTS JOINT_COUNT

/* Joints in the order of every array: JOINT_NAMES. */

/* How much later than it is commanded each torque acts [s]: ask for the motion at time + delay. */
extern const double NAME_torque_delay[UPPER_JOINTS];

/* What presliding friction remembers from one call to the next. */
typedef struct {
    int started;
    double theta[UPPER_JOINTS]; /* last motor position [rad] */
    double share[UPPER_JOINTS]; /* of the sliding friction, -1 ... 1 */
} NAME_memory;

typedef struct {
    double tau[UPPER_JOINTS];            /* motor torque to command [Nm] */
    double theta[UPPER_JOINTS];          /* motor position that belongs to it [rad] */
    double theta_velocity[UPPER_JOINTS]; /* its velocity [rad/s] */
    double tau_joint[UPPER_JOINTS];      /* torque in the elastic joints [Nm] */
} NAME_feed_forward;

/* To be called before the first use of a memory. */
void NAME_reset(NAME_memory *memory);

/* What the drives need for a desired motion of the links.
 * q ... d4q: link positions [rad] and their four derivatives;
 * time: since this run began with cold gears [s], HUGE_VAL: they are warm;
 * memory: of presliding friction, the same one at every cycle; NULL: its sliding friction acts at once. */
void NAME_inverse_dynamics(const double q[UPPER_JOINTS], const double dq[UPPER_JOINTS],
                           const double ddq[UPPER_JOINTS], const double d3q[UPPER_JOINTS],
                           const double d4q[UPPER_JOINTS], double time, NAME_memory *memory,
                           NAME_feed_forward *out);

/* Motor torque [Nm] as if the joints were rigid, for motions of which only ddq is known. */
void NAME_rigid_inverse_dynamics(const double q[UPPER_JOINTS], const double dq[UPPER_JOINTS],
                                 const double ddq[UPPER_JOINTS], double time, NAME_memory *memory,
                                 double tau[UPPER_JOINTS]);

/* Torque that the links take, friction behind the elastic joints included [Nm]. */
void NAME_link_torque(const double q[UPPER_JOINTS], const double dq[UPPER_JOINTS],
                      const double ddq[UPPER_JOINTS], double tau_joint[UPPER_JOINTS]);

#ifdef __cplusplus
}
#endif

#endif
