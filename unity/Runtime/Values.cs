// What a client sends and receives, as plain values. Lengths are metres in reports and millimetres in commands, in the
// device's frame: x right, y up, z towards the user.
using System;

namespace Hapticd
{
    /// <summary>Three numbers: a position, a direction, a force.</summary>
    public struct Triple
    {
        public double X, Y, Z;
        public Triple(double x, double y, double z) { X = x; Y = y; Z = z; }
        public override string ToString()
        {
            return FormattableString.Invariant($"({X:g4}, {Y:g4}, {Z:g4})");
        }
    }

    /// <summary>A unit quaternion.</summary>
    public struct Rotation
    {
        public double X, Y, Z, W;
        public Rotation(double x, double y, double z, double w) { X = x; Y = y; Z = z; W = w; }
        public static readonly Rotation Identity = new Rotation(0, 0, 0, 1);
    }

    /// <summary>One tick of the servo loop, as `hapticd Tick` carries it.</summary>
    public struct TickReport
    {
        public ulong Tick;               // number of the tick, from 1
        public long Time_ns;             // on the server's monotonic clock
        public ulong Revision;           // of the scene
        public Triple Hand_m;            // where the device is
        public Triple Proxy_m;           // where the hand would be if surfaces were hard
        public Triple Velocity_m_per_s;
        public Rotation Orientation;     // from stylus to world
        public Triple Force_N;           // on the hand, as written to the device
        public double Depth_m;           // of penetration
        public int Object;               // touched; -1: none
        public uint Buttons;             // bit 0 is button 0
        public uint GuardActive;         // trips that act, as bits; docs/safety.md names them
        public uint GuardLatched;        // trips that wait for RearmForces()

        public bool Touching { get { return Object >= 0; } }
        public bool Pressed(int button) { return (Buttons >> button & 1) != 0; }
    }

    public enum Severity { Normal = 0, Warning = 1, Error = 2 }

    /// <summary>How a surface feels; all but the mass of the server's model range from 0 to 1. docs/haptics.md has the laws.</summary>
    [Serializable]
    public struct Surface
    {
        public float Stiffness;        // 1: 500 N/m, or what the device can bear; 0 cannot be felt
        public float Damping;          // 1: 2 N s/m
        public float StaticFriction;   // Coulomb coefficient
        public float DynamicFriction;  // Coulomb coefficient, at most the static one
        public float Popthrough;       // force at which the surface gives way; 0: never

        public static Surface Of(float stiffness)
        {
            return new Surface { Stiffness = stiffness };
        }
    }

    /// <summary>Sides of triangles that are rendered.</summary>
    public enum Faces { Front = 0, Back = 1, Both = 2 }
}
