// Between Unity's frame (left-handed, metres, z away from the user) and the device's (right-handed, z towards the user,
// metres in reports and millimetres in commands): z changes its sign.
using UnityEngine;

namespace Hapticd
{
    static class DeviceFrame
    {
        const float MillimetresInMetre = 1000;

        public static Vector3 ToUnity(Triple v) { return new Vector3((float)v.X, (float)v.Y, -(float)v.Z); }

        public static Quaternion ToUnity(Rotation q)
        {
            return new Quaternion(-(float)q.X, -(float)q.Y, (float)q.Z, (float)q.W);
        }

        public static float[] Vertices(Vector3[] vertices)
        {
            float[] numbers = new float[3 * vertices.Length];
            for (int i = 0; i < vertices.Length; ++i)
            {
                numbers[3 * i] = MillimetresInMetre * vertices[i].x;
                numbers[3 * i + 1] = MillimetresInMetre * vertices[i].y;
                numbers[3 * i + 2] = -MillimetresInMetre * vertices[i].z;
            }
            return numbers;
        }

        /// <summary>Unity's fronts are clockwise, the server's counter-clockwise.</summary>
        public static int[] Triangles(int[] triangles)
        {
            int[] turned = (int[])triangles.Clone();
            for (int i = 0; i + 2 < turned.Length; i += 3)
            {
                turned[i + 1] = triangles[i + 2];
                turned[i + 2] = triangles[i + 1];
            }
            return turned;
        }

        /// <summary>The placement of an object before a device, as SetTransform() takes it.</summary>
        public static double[] Columns(Transform device, Matrix4x4 localToWorld, float scale)
        {
            Matrix4x4 toDevice = Matrix4x4.TRS(device.position, device.rotation, Vector3.one).inverse * localToWorld;
            double[] columns = new double[16];
            for (int column = 0; column < 4; ++column)
            {
                for (int row = 0; row < 3; ++row)
                {
                    float sign = (row == 2) != (column == 2) ? -1 : 1;
                    float unit = column == 3 ? MillimetresInMetre : 1;
                    columns[4 * column + row] = sign * unit * toDevice[row, column] / scale;
                }
            }
            columns[15] = 1;
            return columns;
        }
    }
}
